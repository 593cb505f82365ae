"""Unusual things that right drivers do, one a test: nothing of them may be a violation."""

F0, F1 = 0x01, 0x02
NOTED = {
    "test_lm629_a_breakpoint_behind_it": {"lm628.left-armed"},
    "test_mc1241a_the_motor_command_past_the_buffer": {"mc1241a.motor-command-lost"},
    "test_mc1241a_both_axes_by_one_update_and_only_one_moves": {"mc1241a.idle-update"},
    "test_mc1241a_a_move_without_the_stall_check": {"mc1241a.no-step-ratio"},
}
"""Notes beside the one of a host that reads no checksum: what was done may be meant."""


def _ready(lm629):
    axis = lm629.host
    axis.check_reset()
    axis.load_filter(kp=300, kd=2000)
    return axis


def test_lm629_loads_one_gain_at_a_time(lm629):
    axis = lm629.host
    for name in ("kp", "kd"):
        axis.load_filter(**{name: 300}, update=False)
    axis.udf()
    axis.move(500, acc=400, vel=4 << 16)


def test_lm629_loads_the_same_filter_before_every_move(lm629):
    axis = lm629.host
    for target in (100, 200, 200):
        axis.load_filter(kp=300, kd=2000)
        axis.move(target, acc=400, vel=4 << 16)


def test_lm629_udf_in_motion(lm629):
    axis = _ready(lm629)
    axis.load_trajectory(acc=400, vel=4 << 16, pos=5000, start=True)
    lm629.bus.delay("50ms")
    axis.load_filter(kp=400, kd=2500)
    lm629.clock.advance("1 s")


def test_lm629_loads_the_next_move_while_one_runs(lm629):
    axis = _ready(lm629)
    axis.load_trajectory(acc=400, vel=4 << 16, pos=2000, start=True)
    axis.load_trajectory(pos=-500)
    lm629.clock.advance("1 s")
    axis.stt()
    lm629.clock.advance("1 s")


def test_lm629_a_velocity_of_0_holds_in_velocity_mode(lm629):
    axis = _ready(lm629)
    for velocity in (4 << 16, 0, 1, 0x8000, 0):
        axis.load_trajectory(vel=velocity, acc=400 if velocity == 4 << 16 else None,
                             velocity_mode=True, start=True)  # fmt: skip
        lm629.bus.delay("600ms")


def test_lm629_a_loop_that_turns_the_motor_off_at_rest_and_on(lm629):
    axis = _ready(lm629)
    for target in (300, -300):
        axis.move(target, acc=400, vel=4 << 16)
        axis.stop("off")
        lm629.bus.delay("20ms")


def test_lm629_polls_signals_and_resets_no_flag(lm629):
    axis = _ready(lm629)
    axis.load_trajectory(acc=400, vel=4 << 16, pos=500, start=True)
    for _ in range(200):
        axis.rdsigs()
        lm629.bus.delay("1ms")


def test_lm629_resets_flags_before_any_is_set(lm629):
    axis = lm629.host
    for _ in range(3):
        axis.rsti(0)
    axis.rsti(0xFFFB)


def test_lm629_integral_alone(lm629):
    axis = lm629.host
    axis.load_filter(ki=50, il=1000, kd=2000)
    axis.load_trajectory(acc=400, vel=1 << 16, pos=50, start=True)
    lm629.bus.delay("200ms")


def test_lm629_is_reset_again_by_its_command(lm629):
    axis = _ready(lm629)
    axis.move(100, acc=400, vel=4 << 16)
    axis.reset()
    lm629.bus.delay("3ms")
    axis.check_reset()


def test_lm629_a_breakpoint_behind_it(lm629):
    axis = _ready(lm629)
    axis.sbpa(-100)
    axis.move(500, acc=400, vel=4 << 16)


def test_lm629_a_move_to_where_it_stands(lm629):
    axis = _ready(lm629)
    axis.move(0, acc=400, vel=4 << 16)
    axis.move(0, acc=400, vel=4 << 16)


def _control(mcp1200):
    axis = mcp1200.host
    axis.wait_flags(F1, F1)
    axis.write_config(0x01)
    axis.write_feature(0x08)
    axis.write_kp(70)
    axis.write_kd(70)
    axis.control()
    return axis


def test_lm628_12_bits_again_after_each_reset(lm628):
    axis = lm628.host
    for target in (200, 300):
        axis.reset()
        lm628.bus.delay("2ms")
        axis.port12()
        axis.load_filter(kp=300, kd=2000)
        axis.move(target, acc=400, vel=4 << 16)


def test_lm629_from_velocity_mode_to_a_target_and_slower_on_the_way(lm629):
    axis = _ready(lm629)
    axis.load_trajectory(acc=400, vel=4 << 16, velocity_mode=True, start=True)
    lm629.bus.delay("100ms")
    axis.load_trajectory(pos=4000, start=True)
    axis.load_trajectory(vel=2 << 16)
    lm629.bus.delay("50ms")
    axis.stt()
    lm629.bus.delay("2s")


def test_lm629_goes_on_after_the_motor_was_off_with_both_positions_read(lm629):
    axis = _ready(lm629)
    axis.lpes(200)
    lm629.board.faults.arm("jam", when="position 500", until="for 300 ms")
    axis.load_trajectory(acc=400, vel=4 << 16, pos=3000, start=True)
    lm629.bus.delay("1s")
    desired, _ = axis.rddp(), axis.rdrp()
    axis.rsti(0)
    axis.load_trajectory(pos=desired, start=True)
    lm629.bus.delay("1s")
    axis.move(3000)


def test_lm629_gains_for_what_comes_next_are_loaded_under_way(lm629):
    axis = _ready(lm629)
    axis.load_trajectory(acc=400, vel=4 << 16, pos=2000, start=True)
    axis.load_filter(kp=200, kd=1500, update=False)
    lm629.clock.advance("1 s")
    axis.udf()


def test_mcp1200_the_final_position_low_byte_last(mcp1200):
    axis = _control(mcp1200)
    axis.write_acceleration(0x18)
    axis.write_profile_velocity(10)
    for register, byte in ((0x2B, 0), (0x2A, 8), (0x29, 0)):
        mcp1200.bus.write(register, byte)
    axis.set_flag(0)
    axis.wait_flags(F0, 0)


def test_mcp1200_a_new_final_position_under_way(mcp1200):
    axis = _control(mcp1200)
    axis.write_acceleration(0x18)
    axis.write_profile_velocity(10)
    axis.write_final_position(3000)
    axis.set_flag(0)
    mcp1200.bus.delay("20ms")
    axis.write_final_position(5000)
    axis.wait_flags(F0, 0)


def test_mcp1200_the_lead_filter_as_the_reset_leaves_it(mcp1200):
    axis = mcp1200.host
    axis.wait_flags(F1, F1)
    axis.control()
    axis.write_command_increment(10)
    mcp1200.bus.delay("20ms")
    axis.idle()


def test_mcp1200_idle_and_control_at_once_after_the_other_was_awaited(mcp1200):
    axis = _control(mcp1200)
    for _ in range(3):
        axis.idle()
        axis.write_command_position(axis.read_actual_position())
        axis.control()


def test_mcp1200_a_status_cleared_though_nothing_is_wrong(mcp1200):
    axis = _control(mcp1200)
    axis.write_status(0)
    axis.write_saturation(0x90)


def test_mcp1200_reads_positions_and_captures_in_any_order_after_r14(mcp1200):
    axis = _control(mcp1200)
    axis.write_acceleration(0x18)
    axis.write_profile_velocity(10)
    axis.write_final_position(3000)
    axis.set_flag(0)
    for registers in ((0x14, 0x12, 0x13), range(0x0C, 0x19), range(0x2C, 0x32)):
        for _ in range(30):
            for register in registers:
                mcp1200.bus.read(register)
            mcp1200.bus.delay("1ms")
    axis.wait_flags(F0, 0)


def test_mcp1200_a_jog_ended_when_the_motor_stands(mcp1200):
    axis = _control(mcp1200)
    axis.write_acceleration(0x08)
    axis.write_velocity_command(10)
    axis.set_flag(5)
    mcp1200.bus.delay("300ms")
    axis.write_velocity_command(0)
    while axis.read_actual_velocity():
        mcp1200.bus.delay("500us")
    axis.clear_flag(5)


def _moved(mc1241a):
    chip = mc1241a.host
    chip.select(1)
    chip.set_buf_mtr_cmd(24000)
    chip.update()
    chip.set_pos(500)
    chip.set_vel(4 << 16)
    chip.set_acc(0x1000)
    chip.update()
    return chip


def test_mc1241a_clears_all_events_at_its_start(mc1241a):
    chip = mc1241a.host
    for axis in (1, 2):
        chip.select(axis)
        chip.clr_status()
        chip.rst_intrpt(0)


def test_mc1241a_the_motor_command_past_the_buffer(mc1241a):
    chip = mc1241a.host
    chip.select(1)
    chip.set_mtr_cmd(24000)
    chip.set_pos(500)
    chip.set_vel(4 << 16)
    chip.set_acc(0x1000)
    chip.update()
    mc1241a.bus.delay("400ms")


def test_mc1241a_a_new_position_under_way(mc1241a):
    chip = _moved(mc1241a)
    mc1241a.bus.delay("20ms")
    chip.set_pos(900)
    chip.update()
    mc1241a.bus.delay("400ms")


def test_mc1241a_a_stop_in_motion_and_on_again(mc1241a):
    chip = _moved(mc1241a)
    mc1241a.bus.delay("20ms")
    chip.smooth_stop()
    chip.update()
    mc1241a.bus.delay("300ms")
    chip.update()
    mc1241a.bus.delay("400ms")


def test_mc1241a_both_axes_by_one_update_and_only_one_moves(mc1241a):
    chip = _moved(mc1241a)
    mc1241a.bus.delay("400ms")
    chip.set_pos(0)
    chip.multi_update(3)
    mc1241a.bus.delay("400ms")


def test_mc1241a_a_move_without_the_stall_check(mc1241a):
    chip = mc1241a.host
    chip.set_pos_err(60)
    chip.set_step_ratio(40)
    _moved(mc1241a)
    mc1241a.bus.delay("400ms")
    chip.set_step_ratio(0)
    chip.set_pos(0)
    chip.update()
    mc1241a.bus.delay("400ms")
    chip.set_step_ratio(40)


def test_mc1241a_resets_events_it_does_not_have_and_keeps_another(mc1241a):
    chip = _moved(mc1241a)
    mc1241a.bus.delay("400ms")
    for keep in (0xFFFB, 0xFFFE, 0xFFFF):
        chip.rst_status(keep)
