// Thermometers that stand still while another one, or the heater's command, moves:
//
//     values, command -> since a thermometer last moved by `still`: how near was each other one, how far has the command gone?
//                     -> one is farther away by `shows`, or the command has gone `command_shows`        -> bit of `named`
//
// Bit for bit the Rust crate sagnac-core (watch.rs), which states what to choose for `shows` and `still`. Only the way away from a
// thermometer counts. A thermometer without a sample is not named, and what is known of it stays.
//
// `start` reads every input, for example at a slow update; `busy` follows, and `done` is high in the clock in which `named` is new.
// A `start` while `busy` is ignored. Clocks from `start` to `done`: 2, and for each thermometer 1, or with a sample 10, and then 4 more
// for each other one with a sample and 5 for a command: 110 at most. Reset it with a new image: other thermometers may be in its places.
//
// Where it fails: it does not say which of two is right, and does not see two that are stuck together. Values are in one unit; codes
// will do if every thermometer has the same conversion. Leave out a place that a heater holds at one temperature.
`timescale 1ns / 1ns
`default_nettype none

module sagnac_watch (
    input  wire               clk,
    input  wire               rst,
    input  wire               start,
    input  wire       [127:0] values,         // four, signed, in one unit: 2^-24 degC, or a code
    input  wire        [3:0]  present,        // a bit for each value with a sample
    input  wire               has_command,
    input  wire signed [31:0] command,        // of the heater
    input  wire        [31:0] shows,          // in the values' unit; stable while busy, as are the next two
    input  wire        [31:0] still,
    input  wire        [31:0] command_shows,  // in the command's unit; 0: there is no heater
    output wire               busy,
    output reg                done,
    output reg         [3:0]  named
);
    localparam [2:0] IDLE = 3'd0, SAMPLE = 3'd1, LOW = 3'd2, HIGH = 3'd3, JUDGE = 3'd4, KEEP_LOW = 3'd5, KEEP_HIGH = 3'd6, FINISH = 3'd7;
    // What a thermometer is compared with, in this order: itself, the three others, the command.
    localparam [2:0] ITSELF = 3'd0, COMMAND = 3'd4;
    // Signed numbers as unsigned ones in the same order.
    localparam [31:0] MIDDLE = 32'h80000000;

    reg [2:0] state, against;
    reg [1:0] place;
    wire is_itself = against == ITSELF;
    wire is_command = against == COMMAND;

    // The values in a ring, the one that the thermometer is compared with in front, and their samples' bits with them.
    reg [127:0] ring;
    reg [3:0] there;
    reg has_command_now;
    reg [31:0] command_now, own;
    wire is_there = is_command ? has_command_now : there[0];
    // From its own value; `own` is still 0 when that one is in front.
    wire [32:0] difference = {1'b0, ring[31:0]} - {1'b0, own};
    wire [31:0] distance = difference[32] ? -difference[31:0] : difference[31:0];

    // Since a thermometer last moved: its lowest and highest value, the least distance of each other one, the lowest and highest command.
    // Eight words for each; what is known of them is in a ring too, a bit for each that it is compared with.
    reg [31:0] words [0:31];
    reg [19:0] known;
    reg [31:0] word, sample, low, high;
    wire is_less = word < sample;

    // How far it has gone: from the lowest to the highest, of a distance from the least to this one.
    wire [31:0] gone = high - low;
    reg [31:0] limit;
    wire reached = gone >= limit && !(is_command && command_shows == 32'd0);
    wire anew = state == JUDGE && is_itself && reached;

    wire of_high = state == LOW || state == KEEP_HIGH;
    wire [4:0] at = {place, of_high ? {2'b11, is_command} : against};
    always @(posedge clk) begin
        if (state == KEEP_LOW || state == KEEP_HIGH)
            words[at] <= of_high ? high : low;
        else
            word <= words[at];
    end

    assign busy = state != IDLE;

    // The next one to compare with, or the next thermometer; one without a sample is passed over.
    task go_on;
        begin
            ring <= {ring[31:0], ring[127:32]};
            there <= {there[0], there[3:1]};
            state <= SAMPLE;
            if (is_itself && !is_there)
                known <= {known[4:0], known[19:5]};
            else
                known <= {known[0] || is_there, known[19:1]};
            if (is_command || (is_itself && !is_there)) begin
                own <= 32'd0;
                against <= ITSELF;
                place <= place + 2'd1;
                if (place == 2'd3)
                    state <= FINISH;
            end else
                against <= against + 3'd1;
        end
    endtask

    reg [3:0] found;
    always @(posedge clk) begin
        done <= 1'b0;
        if (state == LOW || anew)
            low <= state == LOW && known[0] && is_less ? word : sample;
        if (state == HIGH || anew)
            high <= state == HIGH && (is_itself || is_command) && known[0] && !is_less ? word : sample;
        if (rst) begin
            state <= IDLE;
            known <= 20'd0;
            named <= 4'd0;
        end else
            case (state)
                IDLE: if (start) begin
                    ring <= values ^ {4{MIDDLE}};
                    there <= present;
                    has_command_now <= has_command;
                    command_now <= command ^ MIDDLE;
                    own <= 32'd0;
                    place <= 2'd0;
                    against <= ITSELF;
                    found <= 4'd0;
                    state <= SAMPLE;
                end
                SAMPLE: if (is_there) begin
                    limit <= is_itself ? still : (is_command ? command_shows : shows);
                    sample <= is_command ? command_now : distance;
                    if (is_itself)
                        own <= distance;
                    state <= LOW;
                end else
                    go_on;
                LOW: state <= HIGH;
                HIGH: state <= JUDGE;
                // SAG-CORE-024
                JUDGE: begin
                    // It has moved: nothing is known of the others any more.
                    if (anew)
                        known[4:1] <= 4'd0;
                    if (reached && !is_itself)
                        found[place] <= 1'b1;
                    state <= KEEP_LOW;
                end
                KEEP_LOW: if (is_itself || is_command)
                    state <= KEEP_HIGH;
                else
                    go_on;
                KEEP_HIGH: go_on;
                FINISH: begin
                    named <= found;
                    done <= 1'b1;
                    state <= IDLE;
                end
            endcase
    end
endmodule

`default_nettype wire
