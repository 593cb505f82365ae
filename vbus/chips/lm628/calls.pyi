# Made from the chip's tables by vbus.cli.generate; change that.
"""The calls of the LM628 and LM629, for asyncio."""

from vbus.chips.lm628.host import Lm628Packets

class Lm628Calls(Lm628Packets):
    """A call for each row of the chip's tables, under the manual's name in lower case.

    Values are plain integers in the chip's own units. Of several words or bytes, the most
    significant one is written first.
    """

    async def reset(self) -> None:
        """Reset LM628 (RESET, 00H, LM-CMD-1).

        Commands may be executed on the fly during motion.
        """

    async def port8(self) -> None:
        """Select 8-Bit Output (PORT8, 05H, LM-CMD-6).

        Commands not applicable to execution during motion.
        """

    async def port12(self) -> None:
        """Select 12-Bit Output (PORT12, 06H, LM-CMD-7).

        Commands not applicable to execution during motion.
        """

    async def dfh(self) -> None:
        """Define Home (DFH, 02H, LM-CMD-3).

        Commands may be executed on the fly during motion.
        """

    async def sip(self) -> None:
        """Set Index Position (SIP, 03H, LM-CMD-4).

        Commands may be executed on the fly during motion.
        """

    async def lpei(self, value: int) -> None:
        """Interrupt on Error (LPEI, 1BH, LM-CMD-16).

        Commands may be executed on the fly during motion.

        Args:
            value: 16 bits, unsigned, in cnt,
                0 to 65535.
        """

    async def lpes(self, value: int) -> None:
        """Stop on Error (LPES, 1AH, LM-CMD-15).

        Commands may be executed on the fly during motion.

        Args:
            value: 16 bits, unsigned, in cnt,
                0 to 65535.
        """

    async def sbpa(self, value: int) -> None:
        """Set Breakpoint, Absolute (SBPA, 20H, LM-CMD-21).

        Commands may be executed on the fly during motion.

        Args:
            value: 32 bits, two's complement, in cnt,
                -2147483648 to 2147483647.
        """

    async def sbpr(self, value: int) -> None:
        """Set Breakpoint, Relative (SBPR, 21H, LM-CMD-22).

        Commands may be executed on the fly during motion.

        Args:
            value: 32 bits, two's complement, in cnt,
                -2147483648 to 2147483647.
        """

    async def mski(self, value: int) -> None:
        """Mask Interrupts (MSKI, 1CH, LM-CMD-17).

        Commands may be executed on the fly during motion.

        Args:
            value: 16 bits, unsigned,
                0 to 65535.
        """

    async def rsti(self, value: int) -> None:
        """Reset Interrupts (RSTI, 1DH, LM-CMD-18).

        Commands may be executed on the fly during motion.

        Args:
            value: 16 bits, unsigned,
                0 to 65535.
        """

    async def lfil(self, control: int, *words: int) -> None:
        """Load Filter Parameters (LFIL, 1EH, LM-CMD-19).

        Commands may be executed on the fly during motion.

        Args:
            control: the control word, which says what follows.
            words: 0 to 4 data words.
        """

    async def udf(self) -> None:
        """Update Filter (UDF, 04H, LM-CMD-5).

        Commands may be executed on the fly during motion.
        """

    async def ltrj(self, control: int, *words: int) -> None:
        """Load Trajectory (LTRJ, 1FH, LM-CMD-20).

        Commands may be executed on the fly during motion.

        Args:
            control: the control word, which says what follows.
            words: 0 to 6 data words.
        """

    async def stt(self) -> None:
        """Start Motion (STT, 01H, LM-CMD-2).

        Command may be executed during motion if acceleration parameter was not changed.
        """

    async def rdsigs(self) -> int:
        """Read Signals Register (RDSIGS, 0CH, LM-CMD-13).

        Commands may be executed on the fly during motion.

        Returns 16 bits, unsigned.
        """

    async def rdip(self) -> int:
        """Read Index Position (RDIP, 09H, LM-CMD-10).

        Commands may be executed on the fly during motion.

        Returns 32 bits, two's complement, in cnt.
        """

    async def rddp(self) -> int:
        """Read Desired Position (RDDP, 08H, LM-CMD-9).

        Commands may be executed on the fly during motion.

        Returns 32 bits, two's complement, in cnt.
        """

    async def rdrp(self) -> int:
        """Read Real Position (RDRP, 0AH, LM-CMD-11).

        Commands may be executed on the fly during motion.

        Returns 32 bits, two's complement, in cnt.
        """

    async def rddv(self) -> int:
        """Read Desired Velocity (RDDV, 07H, LM-CMD-8).

        Commands may be executed on the fly during motion.

        Returns 32 bits, two's complement, in 1/65536 cnt/sample.
        """

    async def rdrv(self) -> int:
        """Read Real Velocity (RDRV, 0BH, LM-CMD-12).

        Commands may be executed on the fly during motion.

        Returns 16 bits, two's complement, in cnt/sample.
        """

    async def rdsum(self) -> int:
        """Read Integration Sum (RDSUM, 0DH, LM-CMD-14).

        Commands may be executed on the fly during motion.

        Returns 16 bits, two's complement.
        """
