// Self-checking bench: sagnac_path_length against the records of reference vectors (docs/reference/vectors.md) in which the loop is
// closed all along; the others belong to the processor that searches and resets. The table comes from the vectors; a changed one is refused.
`timescale 1ns / 1ns
`default_nettype none

module tb_path_length;
    reg clk = 1'b0;
    always #5 clk = ~clk;

    reg rst = 1'b1, tick = 1'b0, preset = 1'b0;
    reg signed [23:0] code = 24'sd0;
    reg signed [63:0] preset_value = 64'sd0;
    wire period, loaded, checking, busy, missed;
    wire [2:0] fault;
    reg write = 1'b0, load = 1'b0;
    reg [6:0] write_address = 7'd0;
    reg [31:0] write_data = 32'd0;
    wire signed [31:0] error, held, modulation;
    wire signed [39:0] plain;
    wire signed [47:0] second;
    wire signed [63:0] integral;
    sagnac_path_length dut (.clk(clk), .rst(rst), .write(write), .write_address(write_address), .write_data(write_data), .load(load),
        .loaded(loaded), .checking(checking), .fault(fault), .busy(busy), .missed(missed), .tick(tick), .code(code), .closed(1'b1), .preset(preset),
        .preset_value(preset_value), .period(period), .error(error), .plain(plain), .second(second), .integral(integral), .held(held),
        .modulation(modulation));

    reg [31:0] words [0:131071];
    reg [8*512-1:0] name;
    integer at, record, n, ticks, runs, tables, longest, clocks;
    wire signed [63:0] wavelength = {{32{words[84][31]}}, words[84]};
    integer bits;
    reg [31:0] seed, hash, crc;
    reg failed;
    reg period_ended = 1'b0;
    always @(posedge clk)
        if (period)
            period_ended = 1'b1;
    reg signed [63:0] place, d, light;
    reg signed [31:0] noise;
    reg [63:0] squared;
    reg [127:0] loss;

    task plant;
        begin
            place = place + $signed({{16{words[at + 5][31]}}, words[at + 5], 16'd0});
            seed = seed * 32'd1664525 + 32'd1013904223;
            noise = words[at + 8][7:0] == 0 ? 32'sd0
                : $signed((seed >> (32 - words[at + 8][7:0])) - (32'd1 << (words[at + 8][7:0] - 1)));
            d = ($signed({{32{held[31]}}, held}) + $signed({{32{modulation[31]}}, modulation}) - (place >>> 32)) % wavelength;
            if (d < 0)
                d = d + wavelength;
            if (d > wavelength / 2)
                d = d - wavelength;
            squared = d * d;
            loss = {64'd0, squared} * {96'd0, words[at + 7]};
            light = (words[at + 8][9] ? $signed({32'd0, words[at + 6]}) : 64'sd0) - $signed(loss[95:32]);
            if (light < 0)
                light = 0;
            light = light + noise;
            code = light > 64'sd8388607 ? 24'sd8388607 : light[23:0];
        end
    endtask

    // Writes a word of the table, or a changed one.
    task put(input [6:0] to, input [31:0] value);
        begin
            @(negedge clk);
            write = 1'b1;
            write_address = to;
            write_data = value;
            @(negedge clk) write = 1'b0;
        end
    endtask

    // Begins the check of the table; a tick meanwhile is missed and a write is refused.
    task load_table(input [2:0] expected);
        begin
            @(negedge clk) load = 1'b1;
            @(negedge clk) load = 1'b0;
            tick = 1'b1;
            @(negedge clk) tick = 1'b0;
            if (!failed && !missed) begin
                $display("FAILED: a tick while the table is checked is not reported");
                failed = 1'b1;
            end
            put(7'd77, 32'd0);
            while (busy)
                @(negedge clk);
            if (!failed && (fault !== expected || loaded !== (expected == 3'd0))) begin
                $display("FAILED: table %0d: fault %0d, loaded %b; the fault should be %0d", tables, fault, loaded, expected);
                failed = 1'b1;
            end
            tables = tables + 1;
        end
    endtask

    // A changed word is a fault, and with its own word again the table is good.
    task spoil(input [6:0] at_word, input [31:0] value, input [2:0] expected);
        begin
            put(at_word, value);
            load_table(expected);
            tick = 1'b1;
            @(negedge clk) tick = 1'b0;
            if (!failed && (!missed || busy)) begin
                $display("FAILED: a tick without a table is not reported");
                failed = 1'b1;
            end
            for (n = 0; n < 128; n = n + 1)
                put(n[6:0], words[4 + n]);
        end
    endtask

    // A value that no table may have, under a right checksum.
    task spoil_number(input [6:0] at_word, input [31:0] value);
        begin
            crc = 32'hffffffff;
            for (n = 0; n < 127; n = n + 1) begin
                crc = crc ^ (n == at_word ? value : words[4 + n]);
                for (bits = 0; bits < 32; bits = bits + 1)
                    crc = (crc >> 1) ^ (crc[0] ? 32'hedb88320 : 32'd0);
            end
            put(7'd127, ~crc);
            spoil(at_word, value, 3'd5);
        end
    endtask

    task run;
        begin
            @(negedge clk);
            // Where the record before it left the integrator.
            preset_value = {words[at - 16 + 15], words[at - 16 + 14]};
            preset = 1'b1;
            @(negedge clk) preset = 1'b0;
            seed = words[at + 2];
            hash = 32'd2166136261;
            place = {words[at + 4], words[at + 3]};
            for (n = 0; n < words[at + 1]; n = n + 1) begin
                @(negedge clk);
                plant;
                period_ended = 1'b0;
                tick = 1'b1;
                @(negedge clk) tick = 1'b0;
                clocks = 0;
                while (busy) begin
                    @(negedge clk);
                    clocks = clocks + 1;
                end
                if (clocks > longest)
                    longest = clocks;
                hash = (hash ^ held) * 32'd16777619;
                hash = (hash ^ modulation) * 32'd16777619;
                if (period_ended)
                    hash = (hash ^ second[31:0]) * 32'd16777619;
                ticks = ticks + 1;
            end
            runs = runs + 1;
            if (hash !== words[at + 9] || error !== words[at + 12] || held !== words[at + 13]
                || integral !== {words[at + 15], words[at + 14]}) begin
                $display("FAILED: record %0d: %h %h %h %h, the vectors say %h %h %h %h%h", record, hash, error, held, integral,
                    words[at + 9], words[at + 12], words[at + 13], words[at + 15], words[at + 14]);
                failed = 1'b1;
            end
        end
    endtask

    initial begin
        failed = 1'b0;
        {ticks, tables, longest} = 96'd0;
        runs = 0;
        if (!$value$plusargs("vectors=%s", name)) begin
            $display("FAILED: +vectors=FILE is missing");
            $finish;
        end
        $readmemh(name, words);
        if (words[0] !== 32'h5a67ac01 || words[1] !== 32'd2) begin
            $display("FAILED: not a vector file of the path-length loop");
            failed = 1'b1;
        end
        repeat (3) @(negedge clk);
        rst = 1'b0;
        at = 4 + (words[2] + 3) / 4;
        for (n = 0; n < 128; n = n + 1)
            put(n[6:0], words[4 + n]);
        // Magic and version change one bit; every word changes the checksum.
        spoil(7'd0, words[4] ^ 32'h00000100, 3'd1);
        spoil(7'd1, words[5] ^ 32'h80000000, 3'd1);
        spoil(7'd2, 32'd1, 3'd2);
        spoil(7'd3, 32'd508, 3'd3);
        for (record = 4; record < 128; record = record + 1)
            spoil(record[6:0], words[4 + record] ^ (32'd1 << (record % 32)), 3'd4);
        // Ticks of a period, delay, shifts, modulation, range.
        spoil_number(7'd70, words[74] ^ 32'h00000001);
        spoil_number(7'd70, {words[74][31:8], 8'd2});
        spoil_number(7'd70, {words[74][31:8], 8'd66});
        spoil_number(7'd70, {words[74][31:16], words[74][7:0], words[74][7:0]});
        spoil_number(7'd70, {8'd0, 8'd41, words[74][15:0]});
        spoil_number(7'd70, words[74] ^ 32'h01000000);
        spoil_number(7'd72, 32'd63);
        spoil_number(7'd74, 32'd63);
        spoil_number(7'd75, 32'h00800001);
        spoil_number(7'd77, words[80]);
        load_table(3'd0);
        for (record = 0; record < words[3] && !failed; record = record + 1) begin
            if (words[at] == 32'd1 && words[at + 8][8])
                run;
            at = at + 16;
        end
        if (!failed && runs > 0)
            $display("PASSED: %0d records with the loop closed, %0d ticks of %0d clocks at most; %0d changed tables refused", runs, ticks,
                longest, tables - 1);
        if (!failed && !(runs > 0))
            $display("FAILED: nothing was run");
        $finish;
    end
endmodule

`default_nettype wire
