// Angle increments: the corrected counts of some ticks, with the number of their last tick, in a queue for a processor.
//
//     tick's counts, status -> sum of `length` ticks -> queue of 2^DEPTH_BITS -> number, counts, status of the oldest
//
// `number` counts the taken ticks since `rst`, so the length of an increment is the difference of two numbers. Where the queue is full,
// the sum goes on until there is room: the increment is longer, and no count is lost. `length` 0 makes none.
//
// Where it fails: a sum beyond 32 bits wraps.
`timescale 1ns / 1ns
`default_nettype none

module sagnac_increments #(
    parameter DEPTH_BITS = 4        // 1 to 10
) (
    input  wire               clk,
    input  wire               rst,
    input  wire        [15:0] length,       // ticks of an increment
    input  wire               tick,         // a tick was taken; its counts are not there yet, or it has none (`gap`)
    input  wire               gap,
    input  wire               valid,        // the counts of the last tick with counts
    input  wire signed [31:0] counts,
    input  wire        [7:0]  status,       // of the tick
    input  wire               drop,         // the oldest increment was read
    output reg  [DEPTH_BITS:0] waiting,
    output wire        [31:0] number,       // of the oldest: two clocks after the queue has it
    output wire signed [31:0] sum,
    output wire        [7:0]  all_status    // every bit of its ticks
);
    reg [71:0] queue [0:(1 << DEPTH_BITS)-1];
    reg [71:0] oldest;
    reg [DEPTH_BITS-1:0] first;
    reg [31:0] ticks;
    reg [15:0] so_far;
    reg signed [31:0] running;
    reg [7:0] bits;

    assign {number, sum, all_status} = oldest;

    // A tick without counts, or the counts of one: never both in a clock, because ticks are three clocks apart.
    wire ends_tick = valid || (tick && gap);
    wire signed [31:0] running_now = valid ? running + counts : running;
    wire [7:0] bits_now = bits | status;
    wire is_long = {1'b0, so_far} + 17'd1 >= {1'b0, length};
    wire is_full = waiting[DEPTH_BITS];
    wire push = ends_tick && length != 16'd0 && is_long && !is_full;
    wire pop = drop && waiting != {(DEPTH_BITS + 1){1'b0}};
    wire [DEPTH_BITS-1:0] behind = first + waiting[DEPTH_BITS-1:0];

    always @(posedge clk) begin
        if (push)
            queue[behind] <= {ticks + 32'd1, running_now, bits_now};
        oldest <= queue[first];
    end

    always @(posedge clk) begin
        if (rst) begin
            waiting <= {(DEPTH_BITS + 1){1'b0}};
            first <= {DEPTH_BITS{1'b0}};
            ticks <= 32'd0;
            so_far <= 16'd0;
            running <= 32'sd0;
            bits <= 8'd0;
        end else begin
            if (ends_tick) begin
                ticks <= ticks + 32'd1;
                if (push || length == 16'd0) begin
                    so_far <= 16'd0;
                    running <= 32'sd0;
                    bits <= 8'd0;
                end else begin
                    so_far <= is_long ? so_far : so_far + 16'd1;
                    running <= running_now;
                    bits <= bits_now;
                end
            end
            if (pop)
                first <= first + {{(DEPTH_BITS - 1){1'b0}}, 1'b1};
            waiting <= waiting + {{DEPTH_BITS{1'b0}}, push} - {{DEPTH_BITS{1'b0}}, pop};
        end
    end
endmodule

`default_nettype wire
