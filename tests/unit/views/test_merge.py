"""Waveforms of several nodes as one text."""

from io import StringIO

import pytest

from vbus.views.wave.merge import merge_waves

LEFT = """\
$version vbus $end
$timescale 1 ps $end
$scope module x $end
$var wire 1 ! HI $end
$var wire 8 " D0-D7 $end
$upscope $end
$enddefinitions $end
#0
$dumpvars
0!
b11111111 "
$end
#30
1!
#70
"""
RIGHT = """\
$version another $end
$timescale 1 ps $end
$scope module y $end
$var real 64 ! place $end
$var string 1 " profile $end
$upscope $end
$enddefinitions $end
#0
$dumpvars
r0.5 !
sat_rest "
$end
#20
r1.5 !
#30
smoving "
#90
"""


def merged(*waves: tuple[str, str]) -> list[str]:
    file = StringIO()
    merge_waves([(name, text.splitlines(keepends=True)) for name, text in waves], file)
    return file.getvalue().splitlines()


def test_nodes_have_a_scope_each_and_one_time_axis() -> None:
    assert merged(("a", LEFT), ("b", RIGHT)) == [
        "$version vbus $end", "$timescale 1 ps $end",
        "$scope module a $end", "$scope module x $end", "$var wire 1 ! HI $end",
        '$var wire 8 " D0-D7 $end', "$upscope $end", "$upscope $end",
        "$scope module b $end", "$scope module y $end", "$var real 64 # place $end",
        "$var string 1 $ profile $end", "$upscope $end", "$upscope $end",
        "$enddefinitions $end",
        "#0", "0!", 'b11111111 "', "r0.5 #", "sat_rest $",
        "#20", "r1.5 #",
        "#30", "1!", "smoving $",
        "#90",
    ]  # fmt: skip


def test_what_happens_in_one_tick_is_in_the_order_of_the_nodes() -> None:
    lines = merged(("b", RIGHT), ("a", LEFT))
    place = lines.index("#30")
    assert lines[place : place + 3] == ["#30", 'smoving "', "1#"]


@pytest.mark.parametrize("count", [94, 95, 94 + 94 * 94, 94 + 94 * 94 + 3])
def test_every_variable_has_an_identifier_of_its_own(count: int) -> None:
    names = [f"p{number}" for number in range(count)]
    rows = [f"$var wire 1 {name} {name} $end" for name in names]
    text = "\n".join([*rows, "$enddefinitions $end", "#5", *(f"1{name}" for name in names), "#5"])
    lines = merged(("a", text))
    codes = [line.split()[3] for line in lines if line.startswith("$var")]
    assert len({*codes}) == count
    assert all(33 <= ord(sign) <= 126 for code in codes for sign in code)
    assert [line for line in lines if line.startswith("1")] == [f"1{code}" for code in codes]
    assert max(map(len, codes)) == (1 if count <= 94 else 2 if count <= 94 * 95 else 3)
    assert lines[-1] == f"1{codes[-1]}"


def test_nodes_of_which_nothing_is_known_have_no_instant() -> None:
    nothing = "$timescale 1 ps $end\n$enddefinitions $end\n"
    assert not [line for line in merged(("a", nothing), ("b", nothing)) if line.startswith("#")]
    assert [line for line in merged(("a", f"{nothing}#5\n")) if line.startswith("#")] == ["#5"]
