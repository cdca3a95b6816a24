// Two photodiodes a quarter fringe apart, counted:
//
//     A B   00 -> 10 -> 11 -> 01 -> 00     one fringe forward
//
// COUNTS_PER_FRINGE 4 counts each step, 2 each change of A, 1 each rise of A with B low. A double step has no
// known direction: it adds nothing and `lost` counts it. Bit for bit sagnac_loops::Quadrature.
//
// SYNCHRONIZED puts two flip-flops before each level, for levels that do not come from this clock; sagnac_constraints.xdc and .sdc take the
// first of them out of the timing. `sample` says when a pair
// is looked at: tie it high to look every clock. `take` gives out what was counted since the last one.
// Fringes faster than a quarter per sample are lost, and counted in `lost`; so is each step beyond what COUNT_BITS hold between two
// `take`s: the count stays at its end. `lost` itself stays at its largest value.
`timescale 1ns / 1ns
`default_nettype none

module sagnac_quadrature #(
    parameter COUNTS_PER_FRINGE = 4,
    parameter COUNT_BITS = 16,
    parameter SYNCHRONIZED = 1
) (
    input  wire                         clk,
    input  wire                         rst,
    input  wire                         sample,
    input  wire                         a,
    input  wire                         b,
    input  wire                         take,
    output reg  signed [COUNT_BITS-1:0] counts,
    output reg  signed [1:0]            step,
    output reg         [31:0]           lost
);
    (* ASYNC_REG = "TRUE" *) reg [1:0] a_steps, b_steps;
    always @(posedge clk) begin
        a_steps <= {a_steps[0], a};
        b_steps <= {b_steps[0], b};
    end
    wire a_now = SYNCHRONIZED != 0 ? a_steps[1] : a;
    wire b_now = SYNCHRONIZED != 0 ? b_steps[1] : b;

    // Places 0 to 3 of the circle, going forward.
    wire [1:0] place = {b_now, a_now ^ b_now};
    reg [1:0] earlier;
    reg seen;
    wire [1:0] moved = place - earlier;
    wire [1:0] onto = moved == 2'd1 ? place : earlier;
    wire counted = COUNTS_PER_FRINGE == 4 || (COUNTS_PER_FRINGE == 2 && onto[0]) || (COUNTS_PER_FRINGE == 1 && onto == 2'd1);
    wire signed [1:0] now = !(sample && seen && counted) ? 2'sd0
        : (moved == 2'd1 ? 2'sd1 : (moved == 2'd3 ? -2'sd1 : 2'sd0));
    wire signed [COUNT_BITS-1:0] now_wide = {{(COUNT_BITS - 1){now[1]}}, now[0]};
    reg signed [COUNT_BITS-1:0] running;
    wire at_most = !running[COUNT_BITS-1] && (&running[COUNT_BITS-2:0]);
    wire at_least = running[COUNT_BITS-1] && !(|running[COUNT_BITS-2:0]);
    wire full = !take && ((now == 2'sd1 && at_most) || (now == -2'sd1 && at_least));

    always @(posedge clk) begin
        if (rst) begin
            seen <= 1'b0;
            earlier <= 2'd0;
            running <= {COUNT_BITS{1'b0}};
            counts <= {COUNT_BITS{1'b0}};
            step <= 2'sd0;
            lost <= 32'd0;
        end else begin
            step <= now;
            running <= take ? now_wide : (full ? running : running + now_wide);
            if (take)
                counts <= running;
            if (sample) begin
                seen <= 1'b1;
                earlier <= place;
            end
            if (((sample && seen && moved == 2'd2) || full) && !(&lost))
                lost <= lost + 32'd1;
        end
    end
endmodule

`default_nettype wire
