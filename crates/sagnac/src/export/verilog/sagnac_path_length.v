// Path-length control, the part that runs every tick: synchronous detector and integrator.
//
//     light -> sum of code*sine over a period -> error -> kp + ki*sum (limits) -> held;  modulation every tick
//
// Bit for bit sagnac_loops::PathLength while it is closing or locked. When to search, to close and to reset a mode is the
// processor's: it sets `closed`, and brings the integrator with `preset` (between two periods).
//
// Latency: `held` and `modulation` of a tick stand eight clocks after it. Products: two of 24*16 bits in the detector, 31*31
// in the gains, each registered.
// Where it fails: a modulation near a resonance of the actuator turns the sign of the error. `second` does not turn: it is
// positive at a peak and negative at a trough. The processor declares a lock only on it.
`timescale 1ns / 1ns
`default_nettype none

module sagnac_path_length (
    input  wire               clk,
    input  wire               rst,
    input  wire               tick,
    input  wire signed [23:0] code,          // light, held to +-2^23 - 1
    input  wire               closed,        // the integrator moves
    input  wire               preset,
    input  wire signed [63:0] preset_value,  // 2^-32 codes
    output reg                period,        // high for a clock when a period's sums are complete
    output reg  signed [31:0] error,
    output reg  signed [39:0] plain,         // the light's own sum over the period
    output reg  signed [47:0] second,        // its second harmonic over the period
    output reg  signed [63:0] integral,
    output reg  signed [31:0] held,
    output reg  signed [31:0] modulation
);
`include "sagnac_path_unit.vh"

    localparam signed [63:0] LOW_Q32 = {LOW, 32'd0};
    localparam signed [63:0] HIGH_Q32 = {HIGH, 32'd0};
    localparam signed [63:0] MIDDLE_HALF_UP = RANGE_MIDDLE_Q32 + 64'sd2147483648;
    localparam signed [63:0] MOST = 64'sh2000000000000000;

    reg [5:0] index;
    reg [5:0] delayed;
    wire signed [15:0] sine = SINE[16*delayed +: 16];
    wire signed [15:0] sine_out = SINE[16*index +: 16];
    wire signed [15:0] cosine = SECOND[16*delayed +: 16];
    reg signed [39:0] light;
    reg signed [47:0] in_phase;
    reg signed [47:0] curved;
    reg signed [39:0] product;
    reg signed [39:0] product_second;
    reg signed [23:0] code_now;
    reg [3:0] stage;
    reg last;

    wire signed [47:0] total = in_phase + {{8{product[39]}}, product};
    wire signed [47:0] total_second = curved + {{8{product_second[39]}}, product_second};
    wire signed [47:0] shifted = total >>> ERROR_SHIFT;
    wire signed [31:0] shifted_held = shifted > 48'sd1073741824 ? 32'sd1073741824
        : (shifted < -48'sd1073741824 ? -32'sd1073741824 : shifted[31:0]);
    reg signed [63:0] by_p, by_i;

    // mantissa*error*2^(32 - shift), to the nearest, held to +-2^61.
    function signed [63:0] scaled;
        input signed [63:0] wide;
        input integer by;
        reg signed [63:0] most;
        begin
            if (by > 32)
                scaled = (wide + (64'sd1 <<< (by - 33))) >>> (by - 32);
            else begin
                most = MOST >>> (32 - by);
                scaled = (wide > most ? most : (wide < -most ? -most : wide)) <<< (32 - by);
            end
        end
    endfunction

    function signed [63:0] in_range;
        input signed [63:0] value;
        in_range = value < LOW_Q32 ? LOW_Q32 : (value > HIGH_Q32 ? HIGH_Q32 : value);
    endfunction

    wire signed [63:0] wanted = in_range(integral + by_p);
    /* verilator lint_off UNUSEDSIGNAL */ // the other bits are dropped on purpose
    wire signed [63:0] half_up = wanted + 64'sd2147483648;
    /* verilator lint_on UNUSEDSIGNAL */
    /* verilator lint_off UNUSEDSIGNAL */ // the other bits are dropped on purpose
    wire signed [63:0] integral_half_up = integral + 64'sd2147483648;
    /* verilator lint_on UNUSEDSIGNAL */
    /* verilator lint_off UNUSEDSIGNAL */ // the other bits are dropped on purpose
    wire signed [63:0] preset_half_up = preset_value + 64'sd2147483648;
    /* verilator lint_on UNUSEDSIGNAL */
    reg signed [47:0] swing;
    wire signed [47:0] swing_half_up = swing + 48'sd16384;
    /* verilator lint_off UNUSEDSIGNAL */ // the other bits are dropped on purpose
    wire signed [47:0] swing_rounded = swing_half_up >>> 15;
    /* verilator lint_on UNUSEDSIGNAL */

    always @(posedge clk) begin
        period <= 1'b0;
        if (rst) begin
            index <= 6'd0;
            delayed <= FIRST_DELAYED;
            in_phase <= 48'sd0;
            curved <= 48'sd0;
            second <= 48'sd0;
            light <= 40'sd0;
            plain <= 40'sd0;
            product <= 40'sd0;
            product_second <= 40'sd0;
            code_now <= 24'sd0;
            error <= 32'sd0;
            integral <= RANGE_MIDDLE_Q32;
            held <= MIDDLE_HALF_UP[63:32];
            modulation <= 32'sd0;
            stage <= 4'd0;
            last <= 1'b0;
            by_p <= 64'sd0;
            by_i <= 64'sd0;
            swing <= 48'sd0;
        end else if (preset) begin
            integral <= preset_value;
            held <= preset_half_up[63:32];
        end else begin
            if (stage != 4'd0)
                stage <= stage == 4'd8 ? 4'd0 : stage + 4'd1;
            case (stage)
                4'd0: if (tick) begin
                    code_now <= code;
                    stage <= 4'd1;
                end
                4'd1: begin
                    product <= code_now * sine;
                    product_second <= code_now * cosine;
                    light <= light + {{16{code_now[23]}}, code_now};
                    last <= index == LAST;
                    index <= index == LAST ? 6'd0 : index + 6'd1;
                    delayed <= delayed == LAST ? 6'd0 : delayed + 6'd1;
                end
                4'd2: begin
                    in_phase <= last ? 48'sd0 : total;
                    curved <= last ? 48'sd0 : total_second;
                    swing <= $signed(MODULATION) * sine_out;
                    if (last) begin
                        error <= shifted_held;
                        plain <= light;
                        second <= total_second;
                        light <= 40'sd0;
                        period <= 1'b1;
                    end
                end
                4'd3: begin
                    by_i <= $signed(KI_MANTISSA) * error;
                    modulation <= swing_rounded[31:0];
                end
                4'd4: begin
                    by_i <= scaled(by_i, KI_SHIFT);
                    by_p <= $signed(KP_MANTISSA) * error;
                end
                4'd5: begin
                    by_p <= scaled(by_p, KP_SHIFT);
                    if (last && closed)
                        integral <= in_range(integral + by_i);
                end
                4'd6: if (last)
                    held <= closed ? half_up[63:32] : integral_half_up[63:32];
                default: begin end
            endcase
        end
    end
endmodule

`default_nettype wire
