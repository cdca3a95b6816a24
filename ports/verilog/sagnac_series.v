// Slow path of the thermal correction, once per temperature period, with one serial multiplier:
//
//     code -> T -> lag -> rate y --+
//             +--> x --------------+-> terms -> k = 1 + scale, increment, and the slew to it (slope, steeper)
//
// Bit for bit the Rust crate sagnac-core (docs/explanation/arithmetic.md). The constants of one gyro axis are read from the image's
// own words (sagnac_image): four words of an input for each stage, the three of a term.
//
// `start` begins a slow update; a code and a `present` bit per input are read in that clock. A difference of two inputs
// and a repeat of one have neither, nor has a warm-up, whose lag begins at -1 degC after `rst` and is over after `restart`. `ready`
// rises at the end and stays high, with valid outputs, until `taken` (the `applied` of sagnac_fast). `target_now` is the increment that is active at the boundary: sagnac_fast's target. Start early enough:
// docs/explanation/fpga.md has the number of clocks. `restart` resets the inputs, for a new image.
//
// A value beyond reach of the last one (the largest step, which grows while there is no value) is held back until three of them in a row
// lie within the largest step of each other. With it, and after a hold of more than an eighth of tau, the lag begins again, as do those of
// what is derived from the input, and the input settles again. Such a step stays open until the input steps back.
//
// Every product is below 2^89 in size, shifted right with one rounding, halves upward.
// A `start` before `taken` is ignored.
`timescale 1ns / 1ns
`default_nettype none

module sagnac_series #(
    parameter INPUTS = 4,             // most inputs, 1 to 4
    parameter PIECES = 1,             // zones and steps
    parameter HARMONICS = 1,
    parameter DERIVED = 1,            // differences, repeats, warm-ups
    parameter STEP_LIMITS = 1         // largest steps of a thermometer
) (
    input  wire                             clk,
    input  wire                             rst,
    input  wire                             restart,
    input  wire                             start,
    input  wire        [127:0]              codes,
    input  wire        [3:0]                present,
    input  wire signed [47:0] target_now,
    input  wire                             taken,
    input  wire        [2:0]                inputs,       // of the image in force
    input  wire        [5:0]                terms,
    input  wire        [3:0]                highest_order,
    input  wire        [31:0]               slew_ticks,
    output reg         [7:0]                address,      // of a word of the image
    input  wire        [31:0]               word,         // a clock later
    output wire                             busy,
    output reg                              ready,
    output reg                              held,
    output reg         [33:0]               k,
    output reg  signed [47:0] target,
    output reg  signed [47:0] slope,
    output reg         [31:0]               steeper,
    output reg         [5:0]                status
);
    localparam [5:0] IDLE = 6'd0, FETCH = 6'd1, INPUT = 6'd2, SOURCE = 6'd3, HOLD = 6'd4, CONVERT = 6'd5, VALUE = 6'd6,
        CODE = 6'd7, ACCEPT = 6'd8, LAG = 6'd9, LAG_SUM = 6'd10, LAG_RATE = 6'd11, RATE = 6'd12, SCALED_RATE = 6'd13,
        POSITION = 6'd14, SCALED = 6'd15, REPORT = 6'd16, BASIS = 6'd17, BASIS_STEP = 6'd18, BASIS_NEXT = 6'd19,
        BASIS_TURN = 6'd20, TERM_READ = 6'd21, TERM_SHAPE = 6'd22, TERM_ZONE = 6'd23, TURNS = 6'd24,
        TURNS_SQUARE = 6'd25, TURNS_SUM = 6'd26, TURNS_SINE = 6'd27, TERM = 6'd28, TERM_RATE = 6'd29, TERM_ADD = 6'd30,
        SCALE = 6'd31, BIAS = 6'd32, DIVIDE = 6'd33, DIVIDED = 6'd34, FINISH = 6'd35, MULTIPLY = 6'd36, SHIFT = 6'd37,
        REACH = 6'd38, TAKE = 6'd39;

    // What a stage reads of an input, and the last of a term: the words' places.
    localparam [2:0] OF_SOURCE = 3'd0, OF_CODE = 3'd1, OF_LAG = 3'd2, OF_POSITION = 3'd3, OF_REPORT = 3'd4, OF_TERM = 3'd5;

    localparam signed [63:0] ONE_Q31 = 64'sd2147483648;
    localparam signed [63:0] ONE_Q47 = 64'sd140737488355328;
    // A quarter of the sine is z + z*R(z^2): R in Q32, from the constant on, 34 bits each.
    localparam [203:0] REST = {-34'sd14670, 34'sd688100, -34'sd20107381, 34'sd342277046, -34'sd2774394651, 34'sd2451551556};

    reg [5:0] state, back;

    // The multiplier: result = (a*b + rounding) >> shift.
    reg signed [89:0] addend;
    reg signed [89:0] product;
    reg [34:0] factor;
    reg [5:0] bit_count;
    reg [6:0] shift;
    reg round;
    reg [5:0] out_count;
    reg [38:0] shifted_out;
    wire signed [63:0] result = product[63:0];

    // One input at a time.
    reg [127:0] codes_now;
    reg [3:0] present_now;
    reg [2:0] index;
    // A single input needs no memory of four.
    wire [1:0] at = {INPUTS > 2 && index[1], INPUTS > 1 && index[0]};
    reg fresh;
    reg signed [31:0] value_now;
    reg signed [55:0] difference;
    reg signed [54:0] lag_q46 [0:3];
    reg [38:0] remainder [0:3];
    reg signed [31:0] last_q24 [0:3];
    reg [3:0] has_last;
    // A value that is held back, and for how many updates it has stayed.
    reg signed [31:0] step_q24 [0:3];
    reg [1:0] steady [0:3];
    // The sum of the steps since one is open, modulo 2^32; 0 without.
    reg signed [31:0] open_q24 [0:3];
    // How far from the last value a value may lie.
    reg [49:0] reach;
    // A restart: the warm-up is over.
    reg warm;
    // Inputs with a valid value in this update, for the differences of two and the repeats.
    reg [3:0] fresh_now;
    // Those of them that took a step.
    reg [3:0] stepped_now;
    reg [31:0] held_updates [0:3];
    // Updates of the hold without a sample, before one was held back; values since the first one, up to 7.
    reg [15:0] unread_updates [0:3];
    reg [2:0] values [0:3];
    reg [31:0] settled_updates [0:3];
    reg signed [48:0] x [0:3];
    reg signed [34:0] y [0:3];
    reg x_clamped, y_clamped;
    reg [5:0] reported, earlier;
    reg corrected_once;

    // The series.
    reg [3:0] order;
    reg signed [34:0] here, previous;
    reg signed [34:0] basis [0:63];
    // Read separately, so that the basis can be in block memory; zones, steps and harmonics next to it.
    reg signed [34:0] basis_read, piece;
    reg [5:0] term;
    reg signed [55:0] bias;
    reg signed [39:0] scale;

    // The division of the slew.
    reg [47:0] dividend;
    reg [47:0] rest;
    reg [47:0] quotient;
    reg negative;

    wire signed [31:0] code = codes_now[32*at +: 32];
    // Four words of the image, the last one read in `word_3`; each stage has its own names for them.
    reg [31:0] word_0, word_1, word_2, word_3;
    reg [2:0] stage, fetched;
    reg [7:0] term_address;
    wire signed [31:0] gain_mantissa = word_0;
    wire [31:0] alpha_of_source = word_3;
    wire [15:0] largest_step = word_0[23:8];
    wire [4:0] step_growth = word_0[28:24];
    wire signed [31:0] offset = word_1;
    wire signed [31:0] valid_lo = word_2;
    wire signed [31:0] valid_hi = word_3;
    wire [31:0] alpha_mantissa = word_0;
    wire signed [31:0] rate_lo = word_1;
    wire signed [31:0] rate_hi = word_2;
    wire [31:0] y_mantissa = word_3;
    wire signed [31:0] span_lo = word_0;
    wire signed [31:0] span_hi = word_1;
    wire [31:0] x_mantissa = word_2;
    wire [31:0] stale_after_updates = word_0;
    wire [31:0] settling_updates = word_1;
    wire reported_grows = STEP_LIMITS != 0 && word_2[28:24] != 5'd0;
    // Of an input, from its first fetch to its last stage.
    reg [6:0] gain_shift, x_shift, alpha_shift, rate_shift, y_shift;
    reg [1:0] source, minuend, subtrahend;
    reg has_lag, long_hold;

    // Of a term, at the first: kind, input, order and multiplier; its mantissa; shift, shape and knot or turns.
    wire term_scales = word_0[1];
    wire [1:0] term_input = word_0[9:8];
    wire [3:0] term_order = word_0[19:16];
    wire term_rated = word_0[24];
    wire signed [31:0] term_mantissa = word_1;
    wire [6:0] term_shift = word_2[6:0];
    wire [2:0] term_shape = word_2[10:8];
    wire is_harmonic = HARMONICS != 0 && term_shape >= 3'd3;
    wire is_zone = PIECES != 0 && term_shape == 3'd1;
    wire is_piece = (PIECES != 0 && term_shape != 3'd0) || is_harmonic;
    // Turns count from the lower end of the span: the subtraction that a knot needs gives x + 1.
    wire signed [15:0] term_knot = is_harmonic ? 16'sh8000 : word_2[31:16];
    wire [23:0] term_turns = {word_0[23:16], word_2[31:16]};
    wire term_is_cosine = term_shape == 3'd3;
    // From -1 to +1 are 2 in Q47: 50 bits with the sign.
    wire signed [49:0] above_knot = {x[term_input][48], x[term_input]} - {{2{term_knot[15]}}, term_knot, 32'd0};
    wire signed [49:0] half_above = (above_knot + 50'sd65536) >>> 17;
    // A harmonic's knot is -1, the lower end of the span: (x + 1)/2 in Q38.
    wire signed [49:0] position = (above_knot + 50'sd512) >>> 10;
    // The turns in Q56, a cosine's a quarter later: which quarter, how far in it, and as z in Q31.
    wire [1:0] quarter = result[55:54] + {1'b0, term_is_cosine};
    wire [54:0] along = quarter[0] ? 55'h40000000000000 - {1'b0, result[53:0]} : {1'b0, result[53:0]};
    /* verilator lint_off UNUSEDSIGNAL */ // the other bits are rounded away
    wire [54:0] along_half_up = along + 55'h400000;
    /* verilator lint_on UNUSEDSIGNAL */
    reg below;
    reg [31:0] z, square;
    reg [2:0] rest_at;
    wire signed [33:0] rest_here = REST[34*rest_at +: 34];
    wire signed [63:0] rest_sum = result + {{30{rest_here[33]}}, rest_here};
    wire [34:0] sine_sum = result[34:0] + {3'd0, z};
    wire [34:0] sine_size = sine_sum > ONE_Q31[34:0] ? ONE_Q31[34:0] : sine_sum;
    wire signed [34:0] term_basis = is_piece ? piece : basis_read;
    // A repeat subtracts nothing.
    wire signed [31:0] subtracted = source == 2'd2 ? 32'sd0 : last_q24[subtrahend];
    wire signed [32:0] derived = {last_q24[minuend][31], last_q24[minuend]} - {subtracted[31], subtracted};

    // SAG-CORE-002
    wire signed [63:0] value = result + {{32{offset[31]}}, offset};
    wire signed [31:0] value_code = value[31:0];
    wire is_valid = value[63:31] == {33{value[31]}} && value_code >= valid_lo && value_code <= valid_hi;
    // Distances of the value to the last one and to the one that is held back; the sum of the steps with this one.
    wire signed [32:0] from_last = {value_now[31], value_now} - {last_q24[at][31], last_q24[at]};
    wire signed [32:0] from_step = {value_now[31], value_now} - {step_q24[at][31], step_q24[at]};
    wire signed [31:0] open_sum = open_q24[at] + value_now - last_q24[at];
    wire [32:0] largest = {1'b0, largest_step, 16'd0};
    wire [32:0] step_size = from_last[32] ? -from_last : from_last;
    wire [32:0] stay_size = from_step[32] ? -from_step : from_step;
    wire [31:0] open_size = open_sum[31] ? -open_sum : open_sum;
    wire is_back = open_q24[at] != 32'sd0 && {2'd0, open_size} <= {largest, 1'b0};
    // The sum of the product of updates and step.
    wire [49:0] grown = {17'd0, largest} + ({18'd0, result[31:0]} << step_growth);
    wire grows = STEP_LIMITS != 0 && step_growth != 5'd0;
    // SAG-CORE-003
    wire is_step = STEP_LIMITS != 0 && largest_step != 16'd0 && has_last[at] && {17'd0, step_size} > reach;
    wire stays = steady[at] != 2'd0 && stay_size <= largest;
    wire is_taken = fresh && (!is_step || (stays && steady[at] == 2'd2));
    wire source_stepped = DERIVED != 0 && ((source == 2'd2 && stepped_now[minuend])
        || (source == 2'd1 && (stepped_now[minuend] || stepped_now[subtrahend])));
    // SAG-CORE-004
    wire anew = !has_last[at]
        || (has_lag && (is_step || source_stepped || long_hold));
    wire signed [55:0] lag_wide = {lag_q46[at][54], lag_q46[at]};
    wire signed [32:0] both = {span_lo[31], span_lo} + {span_hi[31], span_hi};
    wire signed [32:0] middle = both >>> 1;
    wire signed [31:0] in_span = value_now < span_lo ? span_lo : (value_now > span_hi ? span_hi : value_now);
    wire signed [32:0] from_middle = {in_span[31], in_span} - middle;
    wire signed [63:0] rate_lo_wide = {{32{rate_lo[31]}}, rate_lo};
    wire signed [63:0] rate_hi_wide = {{32{rate_hi[31]}}, rate_hi};
    wire signed [63:0] rate_in_span = result < rate_lo_wide ? rate_lo_wide
        : (result > rate_hi_wide ? rate_hi_wide : result);
    wire signed [34:0] half_here = (here + 35'sd1) >>> 1;
    wire signed [55:0] delta = bias - {{8{target_now[47]}}, target_now};
    wire [47:0] delta_turned = -delta[47:0];
    wire [47:0] trial = {rest[46:0], dividend[47]};
    // No comparison, which would be constant where nothing slews.
    wire [48:0] less = {1'b0, trial} - {17'd0, slew_ticks};
    wire fits = !less[48];
    wire exact = rest == 48'd0;
    // SAG-CORE-001
    wire signed [89:0] rounded = product + 90'sd1;

    assign busy = state != IDLE;

    integer i;

    task multiply;
        input signed [63:0] a;
        input signed [34:0] b;
        input [6:0] by;
        input rounding;
        input [5:0] then;
        begin
            addend <= {{26{a[63]}}, a};
            factor <= b;
            product <= 90'sd0;
            shift <= by;
            round <= rounding;
            bit_count <= 6'd0;
            out_count <= 6'd0;
            shifted_out <= 39'd0;
            back <= then;
            state <= MULTIPLY;
        end
    endtask

    // Which word of an input or term comes after `fetched` others.
    reg [3:0] of_input;
    always @* begin
        case ({stage, fetched[1:0]})
            {OF_SOURCE, 2'd0}: of_input = 4'd1;
            {OF_SOURCE, 2'd1}: of_input = 4'd2;
            {OF_SOURCE, 2'd2}: of_input = 4'd3;
            {OF_SOURCE, 2'd3}: of_input = 4'd9;
            {OF_CODE, 2'd0}: of_input = 4'd15;
            {OF_CODE, 2'd1}: of_input = 4'd0;
            {OF_CODE, 2'd2}: of_input = 4'd4;
            {OF_CODE, 2'd3}: of_input = 4'd5;
            {OF_LAG, 2'd0}: of_input = 4'd9;
            {OF_LAG, 2'd1}: of_input = 4'd10;
            {OF_LAG, 2'd2}: of_input = 4'd11;
            {OF_LAG, 2'd3}: of_input = 4'd12;
            {OF_POSITION, 2'd0}: of_input = 4'd6;
            {OF_POSITION, 2'd1}: of_input = 4'd7;
            {OF_POSITION, 2'd2}: of_input = 4'd8;
            {OF_REPORT, 2'd0}: of_input = 4'd13;
            {OF_REPORT, 2'd1}: of_input = 4'd14;
            {OF_REPORT, 2'd2}: of_input = 4'd15;
            default: of_input = 4'd0;
        endcase
    end
    wire [7:0] next_address = stage == OF_TERM ? term_address + {6'd0, fetched[1:0]} : 8'd32 + {2'd0, at, of_input};

    task fetch;
        input [2:0] what;
        input [5:0] then;
        begin
            stage <= what;
            fetched <= 3'd0;
            back <= then;
            state <= FETCH;
        end
    endtask

    always @(posedge clk) begin
        if (taken)
            ready <= 1'b0;
        if (rst || restart) begin
            state <= IDLE;
            ready <= 1'b0;
            codes_now <= 128'd0;
            present_now <= 4'd0;
            has_last <= 4'd0;
            warm <= !rst;
            held <= 1'b0;
            earlier <= 6'b100000;
            status <= 6'b100000;
            corrected_once <= 1'b0;
            for (i = 0; i < 4; i = i + 1) begin
                lag_q46[i] <= 55'sd0;
                remainder[i] <= 39'd0;
                last_q24[i] <= 32'sd0;
                held_updates[i] <= 32'd0;
                settled_updates[i] <= 32'd0;
                step_q24[i] <= 32'sd0;
                steady[i] <= 2'd0;
                open_q24[i] <= 32'sd0;
                unread_updates[i] <= 16'd0;
                values[i] <= 3'd0;
                x[i] <= 49'sd0;
                y[i] <= 35'sd0;
            end
        end else begin
            case (state)
                IDLE: if (start && !ready) begin
                    codes_now <= codes;
                    present_now <= present;
                    index <= 3'd0;
                    held <= 1'b0;
                    fresh_now <= 4'd0;
                    stepped_now <= 4'd0;
                    reported <= 6'd0;
                    state <= INPUT;
                end
                // Four words of the image: the address is two clocks ahead of the word.
                FETCH: begin
                    fetched <= fetched + 3'd1;
                    address <= next_address;
                    {word_3, word_2, word_1, word_0} <= {word, word_3, word_2, word_1};
                    if (fetched == 3'd5)
                        state <= back;
                end
                INPUT: begin
                    x_clamped <= 1'b0;
                    y_clamped <= 1'b0;
                    if (index == inputs) begin
                        index <= 3'd0;
                        // A held correction keeps the span bits of the values it was computed from.
                        reported <= held ? reported | (earlier & 6'b000011) : reported;
                        state <= held ? FINISH : BASIS;
                    end else
                        fetch(OF_SOURCE, SOURCE);
                end
                // A hold is too long when it is above 2^(shift - 3)/mantissa, an eighth of tau: held*mantissa - 1 has a bit there or higher.
                SOURCE: begin
                    {rate_shift, alpha_shift, x_shift, gain_shift} <= {word_1[30:24], word_1[22:16], word_1[14:8], word_1[6:0]};
                    {subtrahend, minuend, source, y_shift} <= {word_2[25:24], word_2[17:16], word_2[9:8], word_2[6:0]};
                    has_lag <= alpha_of_source != 32'd0;
                    long_hold <= 1'b0;
                    if (alpha_of_source != 32'd0 && held_updates[at] != 32'd0) begin
                        multiply({32'd0, held_updates[at]}, {3'd0, alpha_of_source}, word_1[22:16] - 7'd3, 1'b0, HOLD);
                        product <= -90'sd1;
                    end else
                        state <= CONVERT;
                end
                HOLD: begin
                    long_hold <= result > 64'sd0;
                    state <= CONVERT;
                end
                // An input: its value, if there is one.
                CONVERT: begin
                    fresh <= 1'b0;
                    if (DERIVED != 0 && source == 2'd3) begin
                        product <= 90'sd0;
                        if (!has_last[at] && !warm) begin
                            lag_q46[at] <= -55'sd70368744177664;
                            has_last[at] <= 1'b1;
                            settled_updates[at] <= 32'hffffffff;
                        end
                        state <= VALUE;
                    end else if (DERIVED != 0 && source != 2'd0) begin
                        product <= {{57{derived[32]}}, derived};
                        state <= fresh_now[minuend] && (source == 2'd2 || fresh_now[subtrahend]) ? VALUE : ACCEPT;
                    end else if (present_now[at])
                        multiply({{32{code[31]}}, code}, {{3{gain_mantissa[31]}}, gain_mantissa}, gain_shift, 1'b1, VALUE);
                    else
                        state <= ACCEPT;
                end
                VALUE: fetch(OF_CODE, CODE);
                CODE: begin
                    fresh <= is_valid;
                    value_now <= value_code;
                    reach <= {17'd0, largest};
                    if (is_valid && grows && unread_updates[at] != 16'd0)
                        multiply({48'd0, unread_updates[at]}, {19'd0, largest_step}, 7'd0, 1'b0, REACH);
                    else
                        state <= TAKE;
                end
                REACH: begin
                    reach <= grown;
                    state <= TAKE;
                end
                TAKE: begin
                    fresh <= is_taken;
                    state <= ACCEPT;
                    if (fresh && STEP_LIMITS != 0) begin
                        step_q24[at] <= value_now;
                        steady[at] <= !is_step || is_taken ? 2'd0 : (stays ? steady[at] + 2'd1 : 2'd1);
                    end
                    if (is_taken) begin
                        last_q24[at] <= value_now;
                        stepped_now[at] <= is_step || source_stepped;
                        if (anew) begin
                            lag_q46[at] <= {value_now[31], value_now, 22'd0};
                            remainder[at] <= 39'd0;
                            settled_updates[at] <= 32'd0;
                        end
                        has_last[at] <= 1'b1;
                        // SAG-CORE-028
                        if (grows && is_step && (open_q24[at] != 32'sd0 || values[at] >= 3'd6))
                            open_q24[at] <= is_back ? 32'sd0 : open_sum;
                    end
                end
                ACCEPT: begin
                    value_now <= last_q24[at];
                    difference <= {{2{last_q24[at][31]}}, last_q24[at], 22'd0} - lag_wide;
                    held_updates[at] <= fresh ? 32'd0
                        : (&held_updates[at] ? held_updates[at] : held_updates[at] + 32'd1);
                    if (fresh) begin
                        unread_updates[at] <= 16'd0;
                        values[at] <= &values[at] ? values[at] : values[at] + 3'd1;
                    end else if (steady[at] == 2'd0 && !(&unread_updates[at]))
                        unread_updates[at] <= unread_updates[at] + 16'd1;
                    if (has_last[at] && !(&settled_updates[at]))
                        settled_updates[at] <= settled_updates[at] + 32'd1;
                    y[at] <= 35'sd0;
                    if (!has_last[at])
                        fetch(OF_REPORT, REPORT);
                    else if (has_lag)
                        fetch(OF_LAG, LAG);
                    else
                        fetch(OF_POSITION, POSITION);
                end
                // The lag, and its rate.
                LAG: multiply({{8{difference[55]}}, difference}, {3'd0, alpha_mantissa}, 7'd23, 1'b0, LAG_SUM);
                LAG_SUM: multiply(result + $signed({25'd0, remainder[at]}), 35'sd1, alpha_shift - 7'd23, 1'b0, LAG_RATE);
                // SAG-CORE-005
                LAG_RATE: begin
                    remainder[at] <= shifted_out;
                    lag_q46[at] <= lag_q46[at] + result[54:0];
                    multiply({{8{difference[55]}}, difference}, {3'd0, alpha_mantissa}, 7'd22 + alpha_shift - rate_shift,
                             alpha_shift - rate_shift != 7'd1, RATE);
                end
                RATE: begin
                    y_clamped <= fresh && rate_in_span != result;
                    multiply(rate_in_span, {3'd0, y_mantissa}, y_shift, 1'b1, SCALED_RATE);
                end
                SCALED_RATE: begin
                    y[at] <= result > ONE_Q31 ? ONE_Q31[34:0] : (result < -ONE_Q31 ? -ONE_Q31[34:0] : result[34:0]);
                    fetch(OF_POSITION, POSITION);
                end
                // SAG-CORE-006
                POSITION: begin
                    x_clamped <= fresh && in_span != value_now;
                    multiply({{31{from_middle[32]}}, from_middle}, {3'd0, x_mantissa}, x_shift, 1'b1, SCALED);
                end
                SCALED: begin
                    x[at] <= result > ONE_Q47 ? ONE_Q47[48:0] : (result < -ONE_Q47 ? -ONE_Q47[48:0] : result[48:0]);
                    fetch(OF_REPORT, REPORT);
                end
                // SAG-CORE-010
                REPORT: begin
                    held <= held || !fresh;
                    fresh_now[at] <= fresh;
                    reported <= reported
                        | {1'b0, (settling_updates != 32'd0 && settled_updates[at] <= settling_updates)
               || (reported_grows && (values[at] <= 3'd6 || open_q24[at] != 32'sd0)),
                           !fresh && held_updates[at] > stale_after_updates, !fresh, y_clamped, x_clamped || y_clamped};
                    index <= index + 3'd1;
                    state <= INPUT;
                end
                // T_0 to the highest order of every input.
                BASIS: begin
                    order <= 4'd0;
                    previous <= 35'sd4294967296;
                    if (index == inputs) begin
                        term <= 6'd0;
                        term_address <= 8'd32 + {1'b0, inputs, 4'd0};
                        bias <= 56'sd0;
                        scale <= 40'sd0;
                        state <= TERM_READ;
                    end else
                        multiply({{15{x[at][48]}}, x[at]}, 35'sd1, 7'd15, 1'b1, BASIS_STEP);
                end
                BASIS_STEP: begin
                    basis[{at, 4'd0}] <= ONE_Q31[34:0];
                    here <= result[34:0];
                    order <= 4'd1;
                    state <= BASIS_NEXT;
                end
                BASIS_NEXT: begin
                    basis[{at, order}] <= half_here;
                    if (order >= highest_order) begin
                        index <= index + 3'd1;
                        state <= BASIS;
                    end else
                        multiply({{15{x[at][48]}}, x[at]}, here, 7'd46, 1'b1, BASIS_TURN);
                end
                // 2x*T_n - T_(n-1).
                // SAG-CORE-007
                BASIS_TURN: begin
                    previous <= here;
                    here <= result[34:0] - previous;
                    order <= order + 4'd1;
                    state <= BASIS_NEXT;
                end
                // Terms, one after the other.
                TERM_READ: if (term == terms)
                    multiply({{24{scale[39]}}, scale}, 35'sd1, 7'd8, 1'b1, SCALE);
                else
                    fetch(OF_TERM, TERM_SHAPE);
                // SAG-CORE-008
                TERM_SHAPE: if (is_zone)
                    multiply(above_knot < 50'sd0 ? 64'sd0 : {{14{half_above[49]}}, half_above},
                             above_knot < 50'sd0 ? 35'sd0 : half_above[34:0], 7'd31, 1'b1, TERM_ZONE);
                else if (is_harmonic)
                    multiply({{14{position[49]}}, position}, {11'd0, term_turns}, 7'd0, 1'b0, TURNS);
                else begin
                    basis_read <= basis[{term_input, term_order}];
                    piece <= above_knot < 50'sd0 ? 35'sd0 : ONE_Q31[34:0];
                    state <= TERM;
                end
                TERM_ZONE: begin
                    piece <= result[34:0];
                    state <= TERM;
                end
                // A harmonic: turns, folded into a quarter; z^2; R by Horner; z + z*R.
                // SAG-CORE-009
                TURNS: if (HARMONICS != 0) begin
                    below <= quarter[1];
                    z <= along_half_up[54:23];
                    multiply({32'd0, along_half_up[54:23]}, {3'd0, along_half_up[54:23]}, 7'd31, 1'b1, TURNS_SQUARE);
                end
                TURNS_SQUARE: if (HARMONICS != 0) begin
                    square <= result[31:0];
                    rest_at <= 3'd4;
                    multiply({{30{REST[203]}}, REST[203:170]}, {3'd0, result[31:0]}, 7'd31, 1'b1, TURNS_SUM);
                end
                TURNS_SUM: if (HARMONICS != 0) begin
                    rest_at <= rest_at - 3'd1;
                    if (rest_at == 3'd0)
                        multiply(rest_sum, {3'd0, z}, 7'd32, 1'b1, TURNS_SINE);
                    else
                        multiply(rest_sum, {3'd0, square}, 7'd31, 1'b1, TURNS_SUM);
                end
                TURNS_SINE: if (HARMONICS != 0) begin
                    piece <= below ? -sine_size : sine_size;
                    state <= TERM;
                end
                TERM: if (term_rated)
                    multiply({{29{term_basis[34]}}, term_basis}, y[term_input], 7'd31, 1'b1, TERM_RATE);
                else
                    multiply({{32{term_mantissa[31]}}, term_mantissa}, term_basis, term_shift, 1'b1, TERM_ADD);
                TERM_RATE: multiply({{32{term_mantissa[31]}}, term_mantissa}, result[34:0], term_shift, 1'b1, TERM_ADD);
                // SAG-CORE-011
                TERM_ADD: begin
                    if (term_scales)
                        scale <= scale + result[39:0];
                    else
                        bias <= bias + result[55:0];
                    term <= term + 6'd1;
                    term_address <= term_address + 8'd3;
                    state <= TERM_READ;
                end
                SCALE: begin
                    k <= 34'h100000000 + result[33:0];
                    multiply({{8{bias[55]}}, bias}, 35'sd1, 7'd8, 1'b1, BIAS);
                end
                // The slew to the new increment: floor(delta / slew_ticks) and its remainder.
                BIAS: begin
                    target <= result[47:0];
                    bias <= result[55:0];
                    state <= DIVIDE;
                end
                // SAG-CORE-012
                DIVIDE: begin
                    negative <= delta < 56'sd0;
                    dividend <= delta < 56'sd0 ? delta_turned : delta[47:0];
                    rest <= 48'd0;
                    quotient <= 48'd0;
                    bit_count <= 6'd0;
                    state <= DIVIDED;
                    corrected_once <= 1'b1;
                end
                DIVIDED: if (bit_count == 6'd48 || slew_ticks == 32'd0) begin
                    slope <= !negative ? quotient : (exact ? -quotient : ~quotient);
                    steeper <= !negative || exact ? rest[31:0] : slew_ticks - rest[31:0];
                    state <= FINISH;
                end else begin
                    rest <= fits ? less[47:0] : trial;
                    quotient <= {quotient[46:0], fits};
                    dividend <= {dividend[46:0], 1'b0};
                    bit_count <= bit_count + 6'd1;
                end
                FINISH: begin
                    status <= {!corrected_once, reported[4:0]};
                    earlier <= {!corrected_once, reported[4:0]};
                    ready <= 1'b1;
                    state <= IDLE;
                end
                // The multiplier itself: 35 bits of the factor, the highest of them negative.
                MULTIPLY: begin
                    if (factor[0])
                        product <= bit_count == 6'd34 ? product - addend : product + addend;
                    addend <= addend <<< 1;
                    factor <= {1'b0, factor[34:1]};
                    bit_count <= bit_count + 6'd1;
                    if (bit_count == 6'd34)
                        state <= SHIFT;
                end
                SHIFT: if (shift == 7'd0)
                    state <= back;
                else begin
                    if (out_count < 6'd39)
                        shifted_out[out_count] <= product[0];
                    out_count <= out_count + 6'd1;
                    shift <= shift - 7'd1;
                    product <= round && shift == 7'd1 ? rounded >>> 1 : product >>> 1;
                end
                default: state <= IDLE;
            endcase
        end
    end
endmodule

`default_nettype wire
