// The vote of several thermometers at one place, each with the same conversion:
//
//     codes -> median -> code;  farther than `agree` from it -> a bit of `outvoted`
//
// Of an even number the median is the mean of the two in the middle, rounded down. Two must agree, or both are outvoted and there is no
// code; one alone is used as it is. Bit for bit the Rust crate sagnac-core (watch.rs).
//
// `start` reads every input; `busy` follows, and `done` is high for a clock when the result stands, which it does until the next `start`.
// A `start` while `busy` is ignored. Clocks from `start` to `done`: VOTERS * (VOTERS + 3) + 2, that is 20 for three and 90 for eight.
//
// Where it fails: half of the thermometers or more are wrong in the same way. Stuck ones that agree are sagnac_watch's.
`timescale 1ns / 1ns
`default_nettype none

module sagnac_vote #(
    parameter VOTERS = 3              // 2 to 8
) (
    input  wire                 clk,
    input  wire                 rst,
    input  wire                 start,
    input  wire [32*VOTERS-1:0] codes,       // signed, 32 bits each
    input  wire [VOTERS-1:0]    present,     // a bit for each code with a sample
    input  wire [31:0]          agree,       // in codes; stable while busy
    output wire                 busy,
    output reg                  done,
    output reg                  has_code,    // 0: no sample, or two that disagree
    output reg  signed [31:0]   code,        // 0 without a code
    output reg  [VOTERS-1:0]    outvoted,
    output reg  [3:0]           voters       // how many had a sample
);
    localparam [2:0] IDLE = 3'd0, TAKE = 3'd1, COUNT = 3'd2, RANK = 3'd3, COMPARE = 3'd4, FINISH = 3'd5;
    /* verilator lint_off WIDTH */ // the parameter is an integer, in range
    localparam [2:0] LAST = VOTERS - 1;
    /* verilator lint_on WIDTH */
    // Signed numbers as unsigned ones in the same order.
    localparam [31:0] MIDDLE = 32'h80000000;

    reg [2:0] state, turn, at;
    // The codes in a ring, each in front once a round, and their samples' bits with them.
    reg [32*VOTERS-1:0] ring;
    reg [VOTERS-1:0] there;
    wire [31:0] front = ring[31:0];

    reg [3:0] sum;
    integer i;
    always @* begin
        sum = 4'd0;
        for (i = 0; i < VOTERS; i = i + 1)
            sum = sum + {3'd0, present[i]};
    end

    // How many codes are below one of them, and how many are not above it: its ranks are those between.
    reg [31:0] candidate;
    reg [3:0] below, up_to;
    wire [3:0] upper_rank = voters >> 1;
    wire [3:0] lower_rank = voters[0] ? upper_rank : upper_rank - 4'd1;
    reg [31:0] lower, upper;

    /* verilator lint_off UNUSEDSIGNAL */ // the lowest bit is rounded away
    wire [32:0] both = {1'b0, lower} + {1'b0, upper};
    /* verilator lint_on UNUSEDSIGNAL */
    wire [31:0] median = both[32:1];
    wire [31:0] apart = upper - lower;
    wire disagree = voters == 4'd2 && apart > agree;
    // Two that agree are not far from their median, nor is one alone.
    wire [31:0] from_median = front < median ? median - front : front - median;
    wire is_far = from_median > agree;

    assign busy = state != IDLE;

    task turn_ring;
        begin
            ring <= {ring[31:0], ring[32*VOTERS-1:32]};
            there <= {there[0], there[VOTERS-1:1]};
        end
    endtask

    always @(posedge clk) begin
        done <= 1'b0;
        if (rst) begin
            state <= IDLE;
            has_code <= 1'b0;
            code <= 32'sd0;
            outvoted <= {VOTERS{1'b0}};
            voters <= 4'd0;
        end else
            case (state)
                IDLE: if (start) begin
                    ring <= codes ^ {VOTERS{MIDDLE}};
                    there <= present;
                    voters <= sum;
                    turn <= 3'd0;
                    state <= TAKE;
                end
                // A round for each code: its rank.
                TAKE: begin
                    candidate <= front;
                    below <= 4'd0;
                    up_to <= 4'd0;
                    at <= 3'd0;
                    state <= COUNT;
                end
                COUNT: begin
                    if (there[0] && front < candidate)
                        below <= below + 4'd1;
                    if (there[0] && front <= candidate)
                        up_to <= up_to + 4'd1;
                    turn_ring;
                    at <= at + 3'd1;
                    if (at == LAST)
                        state <= RANK;
                end
                // A missing code has no rank, or that of one which is there and equal to it.
                RANK: begin
                    if (below <= lower_rank && lower_rank < up_to)
                        lower <= candidate;
                    if (below <= upper_rank && upper_rank < up_to)
                        upper <= candidate;
                    turn_ring;
                    turn <= turn + 3'd1;
                    state <= TAKE;
                    if (turn == LAST) begin
                        turn <= 3'd0;
                        state <= COMPARE;
                    end
                end
                // One more: how far each is from the median.
                // SAG-CORE-025
                COMPARE: begin
                    outvoted <= {there[0] && (disagree || is_far), outvoted[VOTERS-1:1]};
                    turn_ring;
                    turn <= turn + 3'd1;
                    if (turn == LAST)
                        state <= FINISH;
                end
                FINISH: begin
                    has_code <= voters != 4'd0 && !disagree;
                    code <= voters != 4'd0 && !disagree ? median ^ MIDDLE : 32'd0;
                    done <= 1'b1;
                    state <= IDLE;
                end
                default: state <= IDLE;
            endcase
    end
endmodule

`default_nettype wire
