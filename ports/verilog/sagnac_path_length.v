// Path-length control, the part that runs every tick: synchronous detector and integrator.
//
//     light -> sum of code*sine over a period -> error -> kp + ki*sum (limits) -> held;  modulation every tick
//
// Bit for bit sagnac_loops::PathLength while it is closing or locked. When to search, to close and to reset a mode is the
// processor's: it sets `closed`, and brings the integrator with `preset` (between two periods).
//
// The loop's numbers are a table (docs/reference/loop-table.md), written as it is, four bytes a word, the first byte in the lowest
// bits; `load` checks it. `fault`: 1 not a table, 2 version, 3 length, 4 CRC, 5 a field's value. A write stops the loop, and so does a
// table that is refused: `held` and `modulation` stay. A good one begins with `held` in the middle of the range. After `rst` there is
// no table.
//
// `held` and `modulation` of a tick stand when `busy` falls: 6 clocks after it, at the end of a period 120 at most (shifts go bit by bit).
// A tick while `busy`, or without a table, raises `missed` for a clock and changes nothing. Products: two of 24*16 bits in the
// detector, 31*31 in the gains, each registered.
//
// Where it fails: a modulation near a resonance of the actuator turns the sign of the error. `second` does not turn: it is
// positive at a peak and negative at a trough. The processor declares a lock only on it.
`timescale 1ns / 1ns
`default_nettype none

module sagnac_path_length (
    input  wire               clk,
    input  wire               rst,
    input  wire               write,         // refused while `checking`
    input  wire        [6:0]  write_address,
    input  wire        [31:0] write_data,
    input  wire               load,          // ignored while `busy`
    output reg                loaded,
    output wire               checking,
    output reg         [2:0]  fault,
    input  wire               tick,
    input  wire signed [23:0] code,          // light, held to +-2^23 - 1
    input  wire               closed,        // the integrator moves
    input  wire               preset,        // ignored while `busy`
    input  wire signed [63:0] preset_value,  // 2^-32 codes
    output wire               busy,
    output reg                missed,
    output reg                period,        // high for a clock when a period's sums are complete
    output reg  signed [31:0] error,
    output reg  signed [39:0] plain,         // the light's own sum over the period
    output reg  signed [47:0] second,        // its second harmonic over the period
    output reg  signed [63:0] integral,
    output reg  signed [31:0] held,
    output reg  signed [31:0] modulation
);
    localparam [3:0] IDLE = 4'd0, SINE = 4'd1, IN_PHASE = 4'd2, SECOND = 4'd3, SUMS = 4'd4, ERROR = 4'd5, BY_I = 4'd6, INTEGRAL = 4'd7,
        BY_P = 4'd8, HELD = 4'd9, BEGIN = 4'd10, READ = 4'd11, LOOK = 4'd12, SUM_BITS = 4'd13, START = 4'd14;
    localparam [2:0] NOT_A_TABLE = 3'd1, VERSION = 3'd2, LENGTH = 3'd3, CRC = 3'd4, FIELD = 3'd5;
    localparam [6:0] SINES = 7'd6, SECONDS = 7'd38, NUMBERS = 7'd70, LAST_WORD = 7'd127;

    // The table.
    reg [31:0] words [0:127];
    reg [31:0] word;
    reg [6:0] address;
    always @(posedge clk) begin
        if (write && !checking)
            words[write_address] <= write_data;
        word <= words[address];
    end

    // Its numbers.
    reg [5:0] last_index, first_delayed, error_shift, kp_shift, ki_shift;
    reg signed [31:0] kp_mantissa, ki_mantissa, amplitude, low, high;

    reg [3:0] state;
    reg numbers;
    reg [31:0] crc, bits;
    reg [4:0] bit_count;

    reg [5:0] index, delayed;
    wire [5:0] next_index = index == last_index ? 6'd0 : index + 6'd1;
    wire signed [15:0] of_delayed = delayed[0] ? word[31:16] : word[15:0];
    wire signed [15:0] of_index = index[0] ? word[31:16] : word[15:0];
    reg signed [39:0] light;
    reg signed [47:0] in_phase, curved;
    reg signed [39:0] product, product_second;
    reg signed [23:0] code_now;
    reg last;
    wire signed [47:0] total = in_phase + {{8{product[39]}}, product};
    wire signed [47:0] total_second = curved + {{8{product_second[39]}}, product_second};
    reg signed [47:0] swing;
    wire signed [47:0] swing_half_up = swing + 48'sd16384;
    /* verilator lint_off UNUSEDSIGNAL */ // the other bits are dropped on purpose
    wire signed [47:0] swing_rounded = swing_half_up >>> 15;
    /* verilator lint_on UNUSEDSIGNAL */

    // Shifts, one bit a clock: right with one rounding, halves upward, or left, held to +-2^61.
    localparam signed [63:0] HALF_MOST = 64'sh1000000000000000;
    localparam signed [63:0] ERROR_MOST = 64'sd1073741824;
    reg signed [63:0] work;
    reg [5:0] shifts;
    reg is_left;
    wire signed [63:0] work_held = work > HALF_MOST ? HALF_MOST : (work < -HALF_MOST ? -HALF_MOST : work);
    wire signed [63:0] rounded = shifts == 6'd1 ? work + 64'sd1 : work;
    wire signed [63:0] shifted = is_left ? work_held <<< 1 : rounded >>> 1;
    /* verilator lint_off UNUSEDSIGNAL */ // the other bits are its sign
    wire signed [63:0] error_held = work > ERROR_MOST ? ERROR_MOST : (work < -ERROR_MOST ? -ERROR_MOST : work);
    /* verilator lint_on UNUSEDSIGNAL */

    wire signed [63:0] low_q32 = {low, 32'd0};
    wire signed [63:0] high_q32 = {high, 32'd0};
    wire signed [63:0] moved = integral + work;
    wire signed [63:0] in_range = moved < low_q32 ? low_q32 : (moved > high_q32 ? high_q32 : moved);
    wire signed [63:0] middle = (low_q32 >>> 1) + (high_q32 >>> 1);
    // Rounded to a code: of what is wanted, of the integrator alone, of a preset, of the middle.
    wire signed [63:0] unrounded = state == START ? middle : (state == IDLE ? preset_value : (closed ? in_range : integral));
    /* verilator lint_off UNUSEDSIGNAL */ // the other bits are dropped on purpose
    wire signed [63:0] half_up = unrounded + 64'sd2147483648;
    /* verilator lint_on UNUSEDSIGNAL */

    assign checking = state >= BEGIN;
    assign busy = state != IDLE;

    // What is wrong with a word, in the first pass and in the second.
    reg [2:0] found;
    always @* begin
        found = 3'd0;
        if (!numbers)
            case (address)
                7'd0: if (word != 32'h4e474153) found = NOT_A_TABLE;
                7'd1: if (word != 32'h544c4341) found = NOT_A_TABLE;
                7'd2: if (word != 32'd2) found = VERSION;
                7'd3: if (word != 32'd512) found = LENGTH;
                LAST_WORD: if (word != ~crc) found = CRC;
                default: found = 3'd0;
            endcase
        else
            case (address)
                NUMBERS: if (word[0] || word[7:0] < 8'd4 || word[7:0] > 8'd64 || word[15:8] >= word[7:0] || word[23:16] > 8'd40
                        || word[31:24] != 8'd0) found = FIELD;
                7'd72, 7'd74: if (word > 32'd62) found = FIELD;
                7'd75: if (word > 32'h00800000) found = FIELD;
                7'd77: if (low >= $signed(word)) found = FIELD;
                default: found = 3'd0;
            endcase
    end

    // The gain's shift as shifts of mantissa*error to 2^-32 codes.
    task scale;
        input signed [31:0] mantissa;
        input [5:0] by;
        input [3:0] then;
        begin
            work <= mantissa * error;
            is_left <= by <= 6'd32;
            shifts <= by <= 6'd32 ? 6'd32 - by : by - 6'd32;
            state <= then;
        end
    endtask

    always @(posedge clk) begin
        period <= 1'b0;
        missed <= tick && (busy || load || preset || !loaded) && !rst;
        if (rst) begin
            state <= IDLE;
            loaded <= 1'b0;
            fault <= 3'd0;
            error <= 32'sd0;
            integral <= 64'sd0;
            held <= 32'sd0;
            modulation <= 32'sd0;
        end else
            case (state)
                IDLE: if (load)
                    state <= BEGIN;
                else if (preset) begin
                    integral <= preset_value;
                    held <= half_up[63:32];
                end else if (tick && loaded) begin
                    code_now <= code;
                    address <= SINES + {2'd0, delayed[5:1]};
                    state <= SINE;
                end
                SINE: begin
                    address <= SECONDS + {2'd0, delayed[5:1]};
                    state <= IN_PHASE;
                end
                IN_PHASE: begin
                    product <= code_now * of_delayed;
                    address <= SINES + {2'd0, next_index[5:1]};
                    state <= SECOND;
                end
                SECOND: begin
                    product_second <= code_now * of_delayed;
                    light <= light + {{16{code_now[23]}}, code_now};
                    last <= index == last_index;
                    index <= next_index;
                    delayed <= delayed == last_index ? 6'd0 : delayed + 6'd1;
                    state <= SUMS;
                end
                SUMS: begin
                    in_phase <= last ? 48'sd0 : total;
                    curved <= last ? 48'sd0 : total_second;
                    swing <= amplitude * of_index;
                    work <= {{16{total[47]}}, total};
                    is_left <= 1'b0;
                    shifts <= error_shift;
                    if (last) begin
                        plain <= light;
                        second <= total_second;
                        light <= 40'sd0;
                    end
                    state <= ERROR;
                end
                // The error's shift rounds down.
                ERROR: begin
                    modulation <= swing_rounded[31:0];
                    work <= work >>> 1;
                    shifts <= shifts - 6'd1;
                    if (!last)
                        state <= IDLE;
                    else if (shifts == 6'd0) begin
                        error <= error_held[31:0];
                        period <= 1'b1;
                        state <= BY_I;
                    end
                end
                BY_I: scale(ki_mantissa, ki_shift, INTEGRAL);
                INTEGRAL: if (shifts != 6'd0) begin
                    work <= shifted;
                    shifts <= shifts - 6'd1;
                end else begin
                    if (closed)
                        integral <= in_range;
                    state <= BY_P;
                end
                BY_P: scale(kp_mantissa, kp_shift, HELD);
                HELD: if (shifts != 6'd0) begin
                    work <= shifted;
                    shifts <= shifts - 6'd1;
                end else begin
                    held <= half_up[63:32];
                    state <= IDLE;
                end
                // The table: checksum, then the numbers.
                BEGIN: begin
                    fault <= 3'd0;
                    loaded <= 1'b0;
                    numbers <= 1'b0;
                    address <= 7'd0;
                    crc <= 32'hffffffff;
                    state <= READ;
                end
                READ: state <= LOOK;
                LOOK: begin
                    bits <= word;
                    bit_count <= 5'd31;
                    address <= address + 7'd1;
                    state <= numbers ? READ : SUM_BITS;
                    if (found != 3'd0) begin
                        fault <= found;
                        state <= IDLE;
                    end else if (!numbers && address == LAST_WORD) begin
                        numbers <= 1'b1;
                        address <= NUMBERS;
                        state <= READ;
                    end
                    if (numbers)
                        case (address)
                            NUMBERS: begin
                                last_index <= word[5:0] - 6'd1;
                                first_delayed <= word[15:8] == 8'd0 ? 6'd0 : word[5:0] - word[13:8];
                                error_shift <= word[21:16];
                            end
                            7'd71: kp_mantissa <= word;
                            7'd72: kp_shift <= word[5:0];
                            7'd73: ki_mantissa <= word;
                            7'd74: ki_shift <= word[5:0];
                            7'd75: amplitude <= word;
                            7'd76: low <= word;
                            7'd77: begin
                                high <= word;
                                if (found == 3'd0)
                                    state <= START;
                            end
                            default: begin end
                        endcase
                end
                SUM_BITS: begin
                    crc <= {1'b0, crc[31:1]} ^ (crc[0] != bits[0] ? 32'hedb88320 : 32'd0);
                    bits <= {1'b0, bits[31:1]};
                    bit_count <= bit_count - 5'd1;
                    if (bit_count == 5'd0)
                        state <= LOOK;
                end
                START: begin
                    loaded <= 1'b1;
                    index <= 6'd0;
                    delayed <= first_delayed;
                    in_phase <= 48'sd0;
                    curved <= 48'sd0;
                    second <= 48'sd0;
                    light <= 40'sd0;
                    plain <= 40'sd0;
                    error <= 32'sd0;
                    integral <= middle;
                    held <= half_up[63:32];
                    modulation <= 32'sd0;
                    state <= IDLE;
                end
                default: state <= IDLE;
            endcase
        if (write && !checking)
            loaded <= 1'b0;
    end
endmodule

`default_nettype wire
