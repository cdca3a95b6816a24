// Fast path of the thermal correction, once a tick:
//
//     acc += raw*k - increment          whole counts go out, the Q0.32 remainder is carried
//
// Bit for bit the Rust crate sagnac-core (docs/explanation/arithmetic.md). Three clocks from `tick` to `valid`. A new increment is
// approached over slew_ticks by an arithmetic progression: the first `steeper` ticks by slope + 1, the others by slope.
//
// `apply` is the `ready` of sagnac_series: it may be high long before its time and is taken when `due` is high, at the
// boundary before a period's first tick; `applied` says so for that clock. A tick that is not taken, because of `due`,
// |raw| > 2^29, a restart in the same clock, or a tick with counts before this one that is still being summed, raises `refused` for a
// clock, and nothing has changed: the counts are the sender's, who offers them again with the next tick or counts them as lost. Ticks
// three clocks apart are never refused for the last reason. `clear` comes between two of them, once `valid` has been. `status` is the slow
// path's of the update in force; `tick_status` that of the last tick, which an update that is ready in time changes before `valid`.
//
// Where it fails: RAW_BITS too small for the pulses of a tick loses them before they get here.
`timescale 1ns / 1ns
`default_nettype none

module sagnac_fast #(
    parameter RAW_BITS = 16            // width of raw, 2 to 32
) (
    input  wire                             clk,
    input  wire                             rst,
    input  wire                             restart,      // new image: the slew ends, an update is due
    input  wire                             clear,        // ends an overflow: counts go out again, from a remainder of zero
    input  wire                             tick,
    input  wire                             gap,          // with tick: no counts for this tick
    input  wire signed [RAW_BITS-1:0]       raw,
    input  wire                             apply,
    input  wire                             apply_held,   // keep k and increment
    input  wire        [33:0]               apply_k,
    input  wire signed [47:0] apply_target,
    input  wire signed [47:0] apply_slope,
    input  wire        [31:0]               apply_steeper,
    input  wire        [5:0]                apply_status,
    input  wire        [31:0]               period_ticks, // of a temperature period; all three stand still but for a restart
    input  wire        [31:0]               slew_ticks,   // of the way to a new increment
    input  wire        [31:0]               output_limit, // 1 to 2^31 - 1
    output wire                             applied,
    output reg         [31:0]               ticks_to_update,
    output reg         [5:0]                status,
    output reg         [5:0]                tick_status,
    output wire                             due,
    output reg                              refused,
    output reg                              valid,
    output reg  signed [31:0]               counts,
    output reg                              limited,
    output reg                              overflow,
    output reg  signed [63:0]               accumulator,
    output reg  signed [47:0] increment,
    output reg  signed [47:0] target,
    output reg         [33:0]               k
);
    localparam [63:0] ACCUMULATOR_BOUND = 64'h2000000000000000;

    reg [31:0] slewing;
    reg [31:0] steeper;
    reg signed [47:0] slope;
    reg taken, summed;
    reg signed [63:0] product;
    reg signed [63:0] sum;

    assign due = ticks_to_update == 32'd0;
    assign applied = apply && due && !rst && !restart;

    wire signed [31:0] raw_wide = {{(32 - RAW_BITS + 1){raw[RAW_BITS-1]}}, raw[RAW_BITS-2:0]};
    // SAG-CORE-017
    wire too_large = !gap && (raw_wide > 32'sd536870912 || raw_wide < -32'sd536870912);
    wire signed [47:0] one_more = {47'd0, steeper != 32'd0};
    wire signed [47:0] next_increment = slewing == 32'd0 ? increment : increment + slope + one_more;

    wire signed [RAW_BITS+34:0] scaled = $signed({{35{raw[RAW_BITS-1]}}, raw}) * $signed({{(RAW_BITS + 1){1'b0}}, k});
    /* verilator lint_off UNUSEDSIGNAL */ // the other bits are dropped on purpose
    wire signed [79:0] scaled_wide = {{(45 - RAW_BITS){scaled[RAW_BITS+34]}}, scaled};
    /* verilator lint_on UNUSEDSIGNAL */

    // Clock, slew, and the product.
    always @(posedge clk) begin
        taken <= 1'b0;
        refused <= 1'b0;
        // SAG-CORE-020
        if (rst || restart) begin
            ticks_to_update <= 32'd0;
            slewing <= 32'd0;
            steeper <= 32'd0;
            slope <= 48'd0;
            target <= rst ? 48'd0 : increment;
            status <= 6'b100000;
            refused <= tick;
            if (rst) begin
                tick_status <= 6'b100000;
                increment <= 48'd0;
                k <= 34'h100000000;
                product <= 64'sd0;
            end
        end else if (applied) begin
            ticks_to_update <= period_ticks;
            status <= apply_status;
            refused <= tick;
            if (!apply_held) begin
                k <= apply_k;
                target <= apply_target;
                slope <= apply_slope;
                steeper <= apply_steeper;
                slewing <= slew_ticks;
                if (slew_ticks == 32'd0)
                    increment <= apply_target;
            end
        // SAG-CORE-016
        end else if (tick && (due || too_large || taken || summed)) begin
            refused <= 1'b1;
        end else if (tick) begin
            ticks_to_update <= ticks_to_update - 32'd1;
            increment <= next_increment;
            if (slewing != 32'd0)
                slewing <= slewing - 32'd1;
            if (slewing != 32'd0 && steeper != 32'd0)
                steeper <= steeper - 32'd1;
            product <= scaled_wide[63:0];
            tick_status <= status;
            taken <= !gap;
        end
    end

    wire signed [63:0] increment_wide = {{16{increment[47]}}, increment};
    wire signed [31:0] limit = output_limit;
    wire signed [31:0] whole = sum[63:32];
    // SAG-CORE-014
    wire signed [31:0] out = whole > limit ? limit : (whole < -limit ? -limit : whole);
    wire signed [63:0] rest = sum - $signed({out, 32'd0});
    wire [63:0] rest_size = rest[63] ? ~rest + 64'd1 : rest;

    // SAG-CORE-013
    // Sum, then whole counts.
    always @(posedge clk) begin
        valid <= 1'b0;
        summed <= 1'b0;
        if (rst) begin
            accumulator <= 64'sd0;
            overflow <= 1'b0;
            counts <= 32'sd0;
            limited <= 1'b0;
            sum <= 64'sd0;
        // SAG-CORE-015
        end else if (clear && overflow) begin
            accumulator <= 64'sd0;
            overflow <= 1'b0;
        end else if (taken) begin
            sum <= accumulator + (product - increment_wide);
            summed <= 1'b1;
        end else if (summed) begin
            valid <= 1'b1;
            limited <= !overflow && out != whole;
            counts <= overflow ? 32'sd0 : out;
            if (!overflow) begin
                accumulator <= rest;
                overflow <= out != whole && rest_size > ACCUMULATOR_BOUND;
            end
        end
    end
endmodule

`default_nettype wire
