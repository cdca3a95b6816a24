// Self-checking bench: sagnac_watch and sagnac_vote against reference vectors (docs/reference/vectors.md). While they are busy, other
// inputs come with another `start`, which must change nothing; and the clocks are those that their heads state.
//
//     +vectors=FILE   [+records=N]     prints PASSED and what was run, or FAILED and the first record that differs
`timescale 1ns / 1ns
`default_nettype none

module tb_watch;
    reg clk = 1'b0;
    always #5 clk = ~clk;

    reg rst = 1'b1, start = 1'b0, has_command = 1'b0;
    reg [127:0] values = 128'd0, values_in = 128'd0;
    reg [3:0] present = 4'd0;
    reg signed [31:0] command = 32'sd0, command_in = 32'sd0;
    reg [31:0] shows = 32'd0, still = 32'd0, command_shows = 32'd0;
    wire busy, done;
    wire [3:0] named;
    sagnac_watch watch (.clk(clk), .rst(rst), .start(start), .values(values_in), .present(present), .has_command(has_command),
        .command(command_in), .shows(shows), .still(still), .command_shows(command_shows), .busy(busy), .done(done), .named(named));

    reg vote_start = 1'b0;
    reg [255:0] codes = 256'd0;
    reg [7:0] voting = 8'd0;
    reg [31:0] agree = 32'd0;
    wire vote_busy, vote_done, has_code;
    wire signed [31:0] code;
    wire [7:0] outvoted;
    wire [3:0] voters;
    sagnac_vote #(.VOTERS(8)) vote (.clk(clk), .rst(rst), .start(vote_start), .codes(codes), .present(voting), .agree(agree),
        .busy(vote_busy), .done(vote_done), .has_code(has_code), .code(code), .outvoted(outvoted), .voters(voters));

    // Three, with the first three codes: the same result wherever the others are missing.
    wire busy3, done3, has_code3;
    wire signed [31:0] code3;
    wire [2:0] outvoted3;
    wire [3:0] voters3;
    sagnac_vote three (.clk(clk), .rst(rst), .start(vote_start), .codes(codes[95:0]), .present(voting[2:0]), .agree(agree), .busy(busy3),
        .done(done3), .has_code(has_code3), .code(code3), .outvoted(outvoted3), .voters(voters3));

    reg [31:0] words [0:65535];
    reg [8*512-1:0] name;
    integer at, record, limit, i, n, clocks, expected, clocks3, longest, updates, votes, of_three;
    reg [31:0] seed, hash, drawn, flags, result;
    reg [31:0] out [0:6];
    reg failed;

    task draw;
        seed = seed * 32'd1664525 + 32'd1013904223;
    endtask

    // The upper `bits` of the next state, about zero.
    task noise(input [31:0] bits);
        begin
            draw;
            drawn = bits == 32'd0 ? 32'd0 : (seed >> (32'd32 - bits)) - (32'd1 << (bits - 32'd1));
        end
    endtask

    task take(input [31:0] word);
        hash = (hash ^ word) * 32'd16777619;
    endtask

    task fail_clocks(input [8*5-1:0] what);
        if (!failed) begin
            $display("FAILED: record %0d: %0d clocks of the %0s, %0d expected", record, clocks, what, expected);
            failed = 1'b1;
        end
    endtask

    // One update, and its clocks: a second start with other inputs comes in the clock behind the first.
    task update;
        begin
            expected = 2;
            for (i = 0; i < 4; i = i + 1) begin
                expected = expected + 1;
                if (present[i])
                    expected = expected + 9 + (has_command ? 5 : 0)
                        + 4 * ({31'd0, present[0]} + {31'd0, present[1]} + {31'd0, present[2]} + {31'd0, present[3]} - 1);
            end
            values_in = values;
            command_in = command;
            start = 1'b1;
            @(negedge clk);
            values_in = ~values;
            command_in = ~command;
            {present, has_command} = ~{present, has_command};
            clocks = 1;
            while (!done && clocks < 200) begin
                @(negedge clk) start = 1'b0;
                clocks = clocks + 1;
            end
            if (clocks != expected || busy)
                fail_clocks("watch");
            if (clocks > longest)
                longest = clocks;
            updates = updates + 1;
        end
    endtask

    task run_watch;
        begin
            seed = words[at + 2];
            flags = words[at + 7];
            for (i = 0; i < 4; i = i + 1)
                if (flags[12 + i])
                    values[32*i +: 32] = words[at + 6];
            for (n = 0; n < words[at + 1] && !failed; n = n + 1) begin
                command = command + words[at + 5];
                draw;
                present = ~flags[11:8] & (~flags[7:4] | seed[31:28]);
                for (i = 0; i < 4; i = i + 1) begin
                    noise(words[at + 4]);
                    if (!flags[i])
                        values[32*i +: 32] = values[32*i +: 32] + words[at + 3] + drawn;
                end
                has_command = flags[16];
                update;
                out[1] = out[1] + (named != 4'd0 ? 32'd1 : 32'd0);
                out[2] = out[2] | {28'd0, named};
                out[3] = {28'd0, named};
                take({28'd0, named});
            end
            out[0] = hash;
            out[4] = values[31:0];
            out[5] = command;
        end
    endtask

    task one_vote;
        begin
            vote_start = 1'b1;
            @(negedge clk);
            codes = ~codes;
            voting = ~voting;
            clocks = 1;
            clocks3 = 0;
            while (!vote_done && clocks < 200) begin
                if (done3)
                    clocks3 = clocks;
                @(negedge clk) vote_start = 1'b0;
                clocks = clocks + 1;
            end
            voting = ~voting;
            expected = 90;
            if (clocks != expected || vote_busy)
                fail_clocks("vote");
            clocks = clocks3;
            expected = 20;
            if (clocks != expected || busy3)
                fail_clocks("three");
            if (voting[7:3] == 5'd0) begin
                of_three = of_three + 1;
                if (!failed && {has_code3, code3, outvoted3, voters3} !== {has_code, code, outvoted[2:0], voters}) begin
                    $display("FAILED: record %0d: three vote otherwise than eight of which five are missing", record);
                    failed = 1'b1;
                end
            end
            votes = votes + 1;
        end
    endtask

    task run_votes;
        begin
            seed = words[at + 2];
            agree = words[at + 3];
            flags = words[at + 7];
            for (n = 0; n < words[at + 1] && !failed; n = n + 1) begin
                draw;
                voting = ~flags[15:8] & (~flags[7:0] | seed[31:24]);
                for (i = 0; i < 8; i = i + 1) begin
                    noise(words[at + 4]);
                    codes[32*i +: 32] = flags[16 + i] ? words[at + 6] : words[at + 5] + drawn;
                end
                one_vote;
                result = {12'd0, voters, outvoted, 7'd0, has_code};
                out[1] = out[1] + (outvoted != 8'd0 ? 32'd1 : 32'd0);
                out[2] = out[2] | {24'd0, outvoted};
                out[3] = result;
                out[4] = code;
                take(result);
                take(code);
            end
            out[0] = hash;
        end
    endtask

    task begin_anew;
        begin
            shows = words[at + 1];
            still = words[at + 2];
            command_shows = words[at + 3];
            values = 128'd0;
            command = 32'sd0;
            rst = 1'b1;
            @(negedge clk) rst = 1'b0;
        end
    endtask

    initial begin
        failed = 1'b0;
        {longest, updates, votes, of_three} = 128'd0;
        if (!$value$plusargs("vectors=%s", name)) begin
            $display("FAILED: +vectors=FILE is missing");
            $finish;
        end
        $readmemh(name, words);
        if (!$value$plusargs("records=%d", limit))
            limit = words[3];
        if (words[0] !== 32'h5a67ac01 || words[1] !== 32'd7) begin
            $display("FAILED: not a vector file of the watch");
            failed = 1'b1;
        end
        @(negedge clk) rst = 1'b0;
        at = 4 + (words[2] + 3) / 4;
        for (record = 0; record < words[3] && record < limit && !failed; record = record + 1) begin
            for (i = 0; i < 7; i = i + 1)
                out[i] = 32'd0;
            hash = 32'd2166136261;
            if (words[at] == 32'd0)
                begin_anew;
            else if (words[at] == 32'd1)
                run_watch;
            else
                run_votes;
            for (i = 0; i < 7; i = i + 1)
                if (!failed && out[i] !== words[at + 9 + i]) begin
                    $display("FAILED: record %0d, output %0d: %h, the vectors say %h", record, i, out[i], words[at + 9 + i]);
                    failed = 1'b1;
                end
            at = at + 16;
        end
        if (!failed && updates > 0 && votes > 0 && of_three > 0)
            $display("PASSED: %0d records, %0d updates, %0d clocks at most, %0d votes, %0d of three", record, updates, longest, votes, of_three);
        else if (!failed)
            $display("FAILED: nothing was run");
        $finish;
    end
endmodule

`default_nettype wire
