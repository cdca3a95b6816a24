# Timing of the export in Vivado: read it with read_xdc, and name your own clock.
#
#   create_clock -name sagnac -period 20.0 [get_ports clk]
#
# The levels of the two comparators come from no clock. Their first flip-flop may take any time to settle; ASYNC_REG keeps it next to the second.
set_false_path -to [get_pins -hierarchical -filter {NAME =~ *a_steps_reg[0]/D || NAME =~ *b_steps_reg[0]/D}]
