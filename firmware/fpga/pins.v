// The modules behind a few pins, so that place and route can tell size and speed: inputs come in by a shift register,
// outputs leave by one. For measuring only.
`default_nettype none

module pins (
    input  wire clk,
    input  wire rst,
    input  wire shift,
    input  wire d,
    input  wire a,
    input  wire b,
    input  wire tick,
    input  wire start,
    output wire q
);
`include "sagnac_unit.vh"
    localparam IN = 32 * 4 + 4;
    reg [IN-1:0] in;
    always @(posedge clk)
        if (shift)
            in <= {in[IN-2:0], d};

    wire signed [RAW_WIDTH-1:0] counts;
    wire [1:0] step;
    wire [31:0] lost;
    sagnac_quadrature #(.COUNTS_PER_FRINGE(4), .COUNT_BITS(RAW_WIDTH)) quadrature (.clk(clk), .rst(rst), .sample(1'b1),
        .a(a), .b(b), .take(tick), .counts(counts), .step(step), .lost(lost));

    wire due, refused, valid, limited, overflow, busy, ready, applied, held;
    wire signed [31:0] corrected;
    wire signed [63:0] accumulator;
    wire signed [INCREMENT_WIDTH-1:0] increment, target, new_target, new_slope;
    wire [33:0] k, new_k;
    wire [31:0] new_steeper;
    wire [5:0] status, new_status;
    reg tick_later;
    always @(posedge clk)
        tick_later <= tick;
    sagnac_fast #(.RAW_BITS(RAW_WIDTH), .INCREMENT_BITS(INCREMENT_WIDTH), .PERIOD_TICKS(PERIOD_TICKS),
                  .SLEW_TICKS(SLEW_TICKS), .OUTPUT_LIMIT(OUTPUT_LIMIT)) fast (
        .clk(clk), .rst(rst), .clear(1'b0), .restart(1'b0), .tick(tick_later), .gap(1'b0), .raw(counts), .apply(ready), .applied(applied), .apply_status(new_status), .status(status),
        .apply_held(held), .apply_k(new_k), .apply_target(new_target), .apply_slope(new_slope),
        .apply_steeper(new_steeper), .due(due), .refused(refused), .valid(valid), .counts(corrected), .limited(limited),
        .overflow(overflow), .accumulator(accumulator), .increment(increment), .target(target), .k(k));
    sagnac_series #(.INCREMENT_BITS(INCREMENT_WIDTH), .ORDER(HIGHEST_ORDER)) series (
        .clk(clk), .rst(rst), .restart(1'b0), .start(start), .codes(in[131:4]), .present(in[3:0]),
        .target_now(target), .taken(applied), .busy(busy), .ready(ready), .held(held), .k(new_k), .target(new_target), .slope(new_slope),
        .steeper(new_steeper), .status(new_status));

    reg [79:0] out;
    always @(posedge clk)
        if (valid)
            out <= {corrected, status, limited, overflow, refused, due, busy, step, lost[31:0], 3'd0};
        else
            out <= {out[78:0], 1'b0};
    assign q = out[79];
endmodule

`default_nettype wire
