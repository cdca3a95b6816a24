# Timing of the export in tools that read SDC (Quartus, Libero, Radiant): add it to the project, and name your own clock.
#
#   create_clock -name sagnac -period 20.0 [get_ports clk]
#
# The levels of the two comparators come from no clock: their first flip-flop may take any time to settle.
set_false_path -to [get_registers {*a_steps[0] *b_steps[0]}]
