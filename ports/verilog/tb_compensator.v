// Self-checking bench: the whole correction against reference vectors (docs/reference/vectors.md), through its bus.
//
//     +vectors=FILE   [+records=N]     prints PASSED and what was run, or FAILED and the first record that differs
//
// The image comes from the vectors and is loaded as a processor loads it. A file may hold several vector files, one behind the other:
// each image but the first replaces one in force. Module 6 is an image alone, with the fault that the loader must find instead of the
// number of records, 0 for none. An advance of n ticks is run as n single ticks, the counts in the first.
//
// With AXI defined the bus is AXI4-Lite, with pauses of random length on each of its channels. With PRESET defined the image is the one
// of sagnac_image.hex, which the hardware checks by itself after each reset, and nothing is loaded.
`timescale 1ns / 1ns
`default_nettype none

module tb_compensator;
    parameter RAW_WIDTH = 32;
    localparam MOST_WORDS = 1048576;
    reg clk = 1'b0;
    always #5 clk = ~clk;

    reg rst = 1'b1, tick = 1'b0, gap = 1'b0;
    reg signed [RAW_WIDTH-1:0] raw = {RAW_WIDTH{1'b0}};
    wire due, refused, irq, valid;
    wire signed [31:0] counts;
    wire [7:0] tick_status;
    reg [31:0] answer;

`ifdef AXI
    reg [10:0] awaddr = 11'd0, araddr = 11'd0;
    reg [31:0] wdata = 32'd0;
    reg [3:0] wstrb = 4'b1111;
    reg awvalid = 1'b0, wvalid = 1'b0, bready = 1'b0, arvalid = 1'b0, rready = 1'b0;
    wire awready, wready, bvalid, arready, rvalid;
    wire [1:0] bresp, rresp;
    wire [31:0] rdata;
    sagnac_axi4_lite #(.RAW_BITS(RAW_WIDTH)) axi (
        .s_axi_aclk(clk), .s_axi_aresetn(!rst), .s_axi_awaddr(awaddr), .s_axi_awprot(3'd0), .s_axi_awvalid(awvalid),
        .s_axi_awready(awready), .s_axi_wdata(wdata), .s_axi_wstrb(wstrb), .s_axi_wvalid(wvalid), .s_axi_wready(wready),
        .s_axi_bresp(bresp), .s_axi_bvalid(bvalid), .s_axi_bready(bready), .s_axi_araddr(araddr), .s_axi_arprot(3'd0),
        .s_axi_arvalid(arvalid), .s_axi_arready(arready), .s_axi_rdata(rdata), .s_axi_rresp(rresp), .s_axi_rvalid(rvalid),
        .s_axi_rready(rready), .tick(tick), .gap(gap), .raw(raw), .due(due), .refused(refused), .irq(irq), .valid(valid), .counts(counts),
        .status(tick_status));

    reg [31:0] pauses = 32'd1;
    reg goes, address_waits, data_waits, read_waits, address_goes, data_goes, read_goes, answer_waits,
        answer_goes, response_waits;

    // A channel goes on in about two clocks of three.
    task pause;
        begin
            pauses = pauses * 32'd1664525 + 32'd1013904223;
            goes = pauses[31:30] != 2'd0 && pauses[29:28] != 2'd3;
        end
    endtask

    task bus_write(input [8:0] to, input [31:0] value);
        begin
            address_waits = 1'b1;
            data_waits = 1'b1;
            awaddr = {to, 2'd0};
            wdata = value;
            while (address_waits || data_waits) begin
                @(negedge clk);
                pause;
                awvalid = awvalid || (address_waits && goes);
                pause;
                wvalid = wvalid || (data_waits && goes);
                address_goes = awvalid && awready;
                data_goes = wvalid && wready;
                @(posedge clk) #1;
                if (address_goes) {address_waits, awvalid} = 2'b00;
                if (data_goes) {data_waits, wvalid} = 2'b00;
            end
            goes = 1'b0;
            while (!(bvalid && bready)) begin
                @(negedge clk);
                pause;
                bready = goes;
            end
            if (bresp !== (wstrb == 4'b1111 ? 2'b00 : 2'b10) && !failed) begin
                $display("FAILED: record %0d: a write to %h is answered by %b", record, to, bresp);
                failed = 1'b1;
            end
            @(posedge clk) #1 bready = 1'b0;
            @(negedge clk);
        end
    endtask

    task bus_read(input [8:0] from);
        begin
            read_waits = 1'b1;
            araddr = {from, 2'd0};
            while (read_waits) begin
                @(negedge clk);
                pause;
                arvalid = arvalid || goes;
                read_goes = arvalid && arready;
                @(posedge clk) #1;
                if (read_goes) {read_waits, arvalid} = 2'b00;
            end
            while (!(rvalid && rready)) begin
                @(negedge clk);
                pause;
                rready = goes;
            end
            answer = rdata;
            if (rresp !== 2'b00 && !failed) begin
                $display("FAILED: record %0d: a read of %h is answered by %b", record, from, rresp);
                failed = 1'b1;
            end
            @(posedge clk) #1 rready = 1'b0;
            @(negedge clk);
        end
    endtask

    task write_and_read(input [8:0] to, input [31:0] value, input [8:0] from);
        begin
            {address_waits, data_waits, read_waits, answer_waits, response_waits} = 5'b11111;
            awaddr = {to, 2'd0};
            wdata = value;
            araddr = {from, 2'd0};
            while (answer_waits || response_waits) begin
                @(negedge clk);
                pause;
                awvalid = awvalid || (address_waits && goes);
                pause;
                wvalid = wvalid || (data_waits && goes);
                pause;
                arvalid = arvalid || (read_waits && goes);
                pause;
                bready = goes;
                pause;
                rready = goes;
                {address_goes, data_goes, read_goes} = {awvalid && awready, wvalid && wready, arvalid && arready};
                answer_goes = rvalid && rready;
                if (answer_goes)
                    answer = rdata;
                response_waits = response_waits && !(bvalid && bready);
                @(posedge clk) #1;
                if (address_goes) {address_waits, awvalid} = 2'b00;
                if (data_goes) {data_waits, wvalid} = 2'b00;
                if (read_goes) {read_waits, arvalid} = 2'b00;
                if (answer_goes) answer_waits = 1'b0;
            end
            {bready, rready} = 2'b00;
            @(negedge clk);
        end
    endtask

    // Two reads and two writes whose answers wait: each gets its own, in order.
    task answers_wait;
        begin
            awaddr = {9'h00e, 2'd0};
            wdata = 32'd1;
            araddr = {9'h000, 2'd0};
            {awvalid, wvalid, arvalid} = 3'b111;
            for (n = 0; n < 40; n = n + 1) begin
                {address_goes, data_goes, read_goes} = {awvalid && awready, wvalid && wready, arvalid && arready};
                bready = n >= 20 && !bready;
                rready = n >= 20 && !rready;
                // The first answers stand still as long as nobody takes them.
                if (n >= 8 && n <= 20 && !failed && (!bvalid || bresp !== 2'b10 || !rvalid || rdata !== 32'h53470001)) begin
                    $display("FAILED: answers that wait are %b %b and %b %h", bvalid, bresp, rvalid, rdata);
                    failed = 1'b1;
                end
                if (n > 20 && rvalid && rready)
                    answer = rdata;
                @(posedge clk) #1;
                // The second of each; the first write has a strobe of some bytes alone.
                if (address_goes) {awvalid, awaddr} = {awaddr == {9'h00e, 2'd0}, 9'h00d, 2'd0};
                if (data_goes) {wvalid, wdata, wstrb} = {wdata == 32'd1, 32'd2, 4'b1111};
                if (read_goes) {arvalid, araddr} = {araddr == {9'h000, 2'd0}, 9'h016, 2'd0};
                @(negedge clk);
            end
            {bready, rready} = 2'b00;
            if (!failed && answer[5:0] != RAW_WIDTH % 64) begin
                $display("FAILED: the second of two reads is %h", answer);
                failed = 1'b1;
            end
        end
    endtask

    // A strobe of some bytes alone changes nothing; one transfer does not disturb another.
    task spoiled_write;
        begin
            bus_write(9'h00e, 32'd9);
            wstrb = 4'b0111;
            bus_write(9'h00e, 32'd5);
            answers_wait;
            bus_read(9'h00e);
            if (!failed && answer !== 32'd9) begin
                $display("FAILED: a write of some bytes alone makes %h of 9", answer);
                failed = 1'b1;
            end
            bus_read(9'h00d);
            if (!failed && answer !== 32'd2) begin
                $display("FAILED: a write whose answer waited makes %h of 2", answer);
                failed = 1'b1;
            end
            // A write and a read at the same time; the serial is not used without an axis.
            for (n = 0; n < 40 && !failed; n = n + 1) begin
                write_and_read(9'h00f, n, 9'h000);
                if (answer !== 32'h53470001)
                    failed = 1'b1;
                bus_read(9'h00f);
                if (failed || answer !== n) begin
                    $display("FAILED: a write and a read at the same time disturb each other: %h", answer);
                    failed = 1'b1;
                end
            end
        end
    endtask
`else
    reg write = 1'b0;
    reg [8:0] address = 9'd0;
    reg [31:0] write_data = 32'd0;
    wire [31:0] read_data;
`ifdef NETLIST
    sagnac_correction correction (
`else
    sagnac_correction #(.RAW_BITS(RAW_WIDTH)
`ifdef PRESET
        , .IMAGE("sagnac_image.hex")
`endif
    ) correction (
`endif
        .clk(clk), .rst(rst), .write(write), .address(address), .write_data(write_data), .read_data(read_data), .tick(tick),
        .gap(gap), .raw(raw), .due(due), .refused(refused), .irq(irq), .valid(valid), .counts(counts), .status(tick_status));

    task bus_write(input [8:0] to, input [31:0] value);
        begin
            @(negedge clk);
            write = 1'b1;
            address = to;
            write_data = value;
            @(negedge clk) write = 1'b0;
        end
    endtask

    task bus_read(input [8:0] from);
        begin
            @(negedge clk) address = from;
            @(negedge clk) answer = read_data;
        end
    endtask

    task spoiled_write;
        begin end
    endtask
`endif

    reg [31:0] words [0:MOST_WORDS-1];
    reg [8*512-1:0] name;
    integer records, limit, at, image_at, image_words, sections, faults, record, i, n;
    reg [31:0] in [0:7];
    reg [31:0] out [0:6];
    reg [31:0] seed, hash, sum, status, last;
    reg signed [31:0] wanted;
    reg failed, started, early;
    integer ready_early;
    localparam LENGTH = 3;
    reg [31:0] totals [0:65535];
    reg [31:0] total, taken, number, number_before;
    integer increments, drained, longer;
    integer ticks, longest, clocks, left, refusals;
    reg [31:0] crc_before;
    reg [31:0] state_before [0:3];

    task noise(input [31:0] bits, output signed [31:0] value);
        begin
            seed = seed * 32'd1664525 + 32'd1013904223;
            value = bits == 0 ? 32'sd0 : $signed((seed >> (32 - bits)) - (32'd1 << (bits - 1)));
        end
    endtask

    task take(input [31:0] word);
        hash = (hash ^ word) * 32'd16777619;
    endtask

    // Inputs change between two rising edges.
    task one_tick(input signed [31:0] value, input without);
        begin
            @(negedge clk);
            raw = value[RAW_WIDTH-1:0];
            if ({{(32 - RAW_WIDTH + 1){raw[RAW_WIDTH-1]}}, raw[RAW_WIDTH-2:0]} !== value && !failed) begin
                $display("FAILED: record %0d has %0d counts in a tick, more than RAW_WIDTH = %0d holds", record, value, RAW_WIDTH);
                failed = 1'b1;
            end
            gap = without;
            tick = 1'b1;
            @(negedge clk);
            tick = 1'b0;
            status = {24'd0, tick_status};
            if (refused)
                refusals = refusals + 1;
            else begin
                clocks = 0;
                while (!without && !valid && clocks < 9) begin
                    @(negedge clk);
                    clocks = clocks + 1;
                end
                if (clocks == 9 && !failed) begin
                    $display("FAILED: record %0d: no counts come out of a tick", record);
                    failed = 1'b1;
                end
                status = {24'd0, tick_status};
                ticks = ticks + 1;
                left = left - 1;
                taken = taken + 1;
                total = total + (without ? 32'd0 : counts);
                totals[taken[15:0]] = total;
            end
        end
    endtask

    // The increments of the queue against the sums of the ticks; then none waits, and nothing interrupts.
    task drain;
        begin
            bus_read(9'h022);
            increments = answer;
            while (increments != 0 && !failed) begin
                bus_read(9'h023);
                number = answer;
                bus_read(9'h024);
                if (answer !== totals[number[15:0]] - totals[number_before[15:0]] || number - number_before < LENGTH || number > taken || !irq) begin
                    $display("FAILED: record %0d: increment %h up to tick %0d from %0d", record, answer, number, number_before);
                    failed = 1'b1;
                end
                longer = longer + (number - number_before > LENGTH ? 1 : 0);
                drained = drained + 1;
                number_before = number;
                bus_write(9'h022, 32'd0);
                bus_read(9'h022);
                increments = increments - 1;
                if (answer !== increments && !failed) begin
                    $display("FAILED: record %0d: %0d increments wait, %0d expected", record, answer, increments);
                    failed = 1'b1;
                end
            end
            if (irq && !failed) begin
                $display("FAILED: record %0d: an interrupt without an increment", record);
                failed = 1'b1;
            end
        end
    endtask

    // A bus write of the control word, and its effect.
    task command(input [31:0] bits);
        begin
            bus_write(9'h001, bits);
            repeat (2) @(negedge clk);
        end
    endtask

    task read_left;
        begin
            bus_read(9'h003);
            left = answer;
        end
    endtask

    task with_state;
        for (i = 0; i < 4; i = i + 1) begin
            bus_read(9'h018 + i[8:0]);
            out[3 + i] = answer;
        end
    endtask

    task read_status;
        begin
            bus_read(9'h002);
            out[2] = answer & 32'hbf;
        end
    endtask

    // Writes the image of this section, and over it while it is checked, and waits for the verdict. The correction stays as it is, but for
    // an update that is due with a new image.
    task load_image(input [2:0] expected);
        begin
            bus_read(9'h005);
            crc_before = answer;
            with_state;
            for (i = 0; i < 4; i = i + 1)
                state_before[i] = out[3 + i];
            bus_read(9'h002);
            status = answer;
`ifndef PRESET
            for (i = 0; i < image_words; i = i + 1)
                bus_write(9'h100 + i[8:0], words[image_at + i]);
            bus_write(9'h001, 32'd1);
`endif
            // The memory does not change under the check.
            bus_write(9'h10d, 32'd0);
            answer = 32'h1000;
            for (clocks = 0; answer[12] && clocks < 20000; clocks = clocks + 1)
                bus_read(9'h002);
            if (!failed && (answer[10:8] !== expected || answer[12] || (expected == 3'd0 && !answer[17]))) begin
                status = answer;
                bus_read(9'h017);
                $display("FAILED: section %0d: state %h after a load, fault in word %0d, fault %0d expected", sections, status,
                         answer, expected);
                failed = 1'b1;
            end
            if (!failed && expected != 3'd0 && answer[11] !== status[11]) begin
                $display("FAILED: section %0d: a refused image changes whether one is in force", sections);
                failed = 1'b1;
            end
            bus_read(9'h005);
            if (!failed && answer !== (expected == 3'd0 ? words[image_at + image_words - 1] : crc_before)) begin
                $display("FAILED: section %0d: image %h is in force", sections, answer);
                failed = 1'b1;
            end
            bus_read(9'h002);
            for (i = 0; i < image_words && expected == 3'd0 && !failed; i = i + 1) begin
                bus_read(9'h100 + i[8:0]);
                if (answer !== words[image_at + i]) begin
                    $display("FAILED: section %0d: word %0d of the image in force reads %h", sections, i, answer);
                    failed = 1'b1;
                end
            end
            bus_read(9'h002);
            if (!failed && (expected == 3'd0 ? !answer[13] || answer[5:0] !== 6'b100000 : {answer[13], answer[7:0]} !== {status[13], status[7:0]})) begin
                $display("FAILED: section %0d: state %h after a load, %h before", sections, answer, status);
                failed = 1'b1;
            end
            with_state;
            for (i = 0; i < 4; i = i + 1) begin
                if (!failed && out[3 + i] !== state_before[i]) begin
                    $display("FAILED: section %0d: a load changes remainder or increment", sections);
                    failed = 1'b1;
                end
                out[3 + i] = 32'd0;
            end
            read_left;
        end
    endtask

    task power_on;
        begin
            @(negedge clk) rst = 1'b1;
            @(negedge clk) rst = 1'b0;
            started = 1'b0;
            refusals = 0;
            {total, taken, number_before, totals[0]} = 128'd0;
            bus_write(9'h020, LENGTH);
            bus_write(9'h021, 32'd1);
            // Without an image nothing is corrected and nothing is lost unseen.
            one_tick(32'sd0, 1'b0);
            if (!refused && !failed) begin
                $display("FAILED: record %0d: a tick without an image is not refused", record);
                failed = 1'b1;
            end
            load_image(3'd0);
        end
    endtask

    // Begins the slow path with the inputs of the record at `from`; they may change behind the start.
    task begin_update(input integer from);
        begin
            for (i = 0; i < 4; i = i + 1)
                bus_write(9'h010 + i[8:0], words[from + 2 + i]);
            bus_write(9'h014, words[from + 1]);
            @(negedge clk);
            for (i = 0; i < 4; i = i + 1)
                bus_write(9'h010 + i[8:0], ~words[from + 2 + i]);
            started = 1'b1;
        end
    endtask

    task update;
        begin
            // An update that was ready is applied already.
            if (!due && !started)
                out[0] = 32'd2;
            else begin
                clocks = 0;
                if (!started)
                    begin_update(at);
                started = 1'b0;
                while (due && clocks < 100000) begin
                    @(negedge clk);
                    clocks = clocks + 1;
                end
                if (due && !failed) begin
                    $display("FAILED: record %0d: no update after %0d clocks", record, clocks);
                    failed = 1'b1;
                end
                if (clocks > longest)
                    longest = clocks;
                read_status;
                out[1] = out[2];
            end
            for (i = 0; i < 4; i = i + 1) begin
                bus_read(i < 2 ? 9'h01e + i[8:0] : 9'h01a + i[8:0]);
                out[2 + i] = answer;
            end
            read_left;
        end
    endtask

    task run;
        integer n;
        begin
            seed = in[1];
            hash = 32'd2166136261;
            sum = 32'd0;
            last = 32'd0;
            read_left;
            for (n = 0; n < in[0]; n = n + 1) begin
                // As hardware does it: two ticks ahead, where the run goes just to the boundary. In every second record the update is ready
                // before the last tick: its status is still that of the period. Without a slew the increment would be the new one.
                if (in[0] - n == 2 && left == 2 && words[at + 16] == 32'd1 && record + 1 < records) begin
                    begin_update(at + 16);
                    if (record % 2 == 0 && words[image_at + 15] != 32'd0) begin
                        answer = 32'd0;
                        for (clocks = 0; !answer[15] && clocks < 100000; clocks = clocks + 1)
                            bus_read(9'h002);
                        ready_early = ready_early + 1;
                    end
                end
                noise(in[3], wanted);
                wanted = wanted + $signed(in[2]);
                one_tick(wanted, 1'b0);
                if (refused) begin
                    last = due ? 32'h10000 : 32'h30000;
                    n = in[0];
                end else begin
                    sum = sum + counts;
                    last = status;
                    take(counts);
                    take(status);
                end
            end
            with_state;
            out[2] = out[3];
            out[3] = out[4];
            out[4] = out[5];
            out[5] = out[6];
            out[0] = sum;
            out[1] = hash;
            out[6] = last;
        end
    endtask

    task advance;
        integer n;
        begin
            if ($signed(in[0]) > 32'sd536870912 || $signed(in[0]) < -32'sd536870912)
                out[0] = 32'd3;
            else if (in[1] > left)
                out[0] = 32'd1;
            else
                for (n = 0; n < in[1]; n = n + 1) begin
                    one_tick(n == 0 ? $signed(in[0]) : 32'sd0, 1'b0);
                    out[1] = out[1] + counts;
                    out[2] = status;
                end
            with_state;
        end
    endtask

    task skip;
        integer n;
        begin
            if (in[0] > left)
                out[0] = 32'd1;
            else
                for (n = 0; n < in[0]; n = n + 1)
                    one_tick(32'sd0, 1'b1);
            read_left;
            out[1] = left;
            with_state;
        end
    endtask

    // A tick while the one before it is being summed is refused, whichever clock it comes in, and changes nothing: no count is lost unseen.
    task too_early;
        integer gap_clocks;
        begin
            for (gap_clocks = 0; gap_clocks < 2; gap_clocks = gap_clocks + 1) begin
                read_left;
                @(negedge clk);
                raw = {{(RAW_WIDTH - 1){1'b0}}, 1'b1};
                gap = 1'b0;
                tick = 1'b1;
                @(negedge clk) tick = 1'b0;
                repeat (gap_clocks) @(negedge clk);
                tick = 1'b1;
                @(negedge clk) tick = 1'b0;
                if (!failed && !refused) begin
                    $display("FAILED: a tick %0d clocks behind another is not refused", gap_clocks + 1);
                    failed = 1'b1;
                end
                refusals = refusals + 1;
                clocks = left;
                read_left;
                if (!failed && left != clocks - 1) begin
                    $display("FAILED: a refused tick counts for the period");
                    failed = 1'b1;
                end
                bus_read(9'h018);
                hash = answer;
                repeat (3) @(negedge clk);
                bus_read(9'h018);
                if (!failed && answer !== hash) begin
                    $display("FAILED: a refused tick changes the remainder");
                    failed = 1'b1;
                end
            end
            // Three clocks apart: taken.
            @(negedge clk) tick = 1'b1;
            @(negedge clk) tick = 1'b0;
            repeat (2) @(negedge clk);
            tick = 1'b1;
            @(negedge clk) tick = 1'b0;
            if (!failed && refused) begin
                $display("FAILED: a tick three clocks behind another is refused");
                failed = 1'b1;
            end
        end
    endtask

    // The image of another unit: serial, axis or tick differ.
    task other_unit;
        begin
            for (i = 0; i < 8; i = i + 1)
                bus_write(9'h008 + i[8:0], words[image_at + 4 + i]);
            bus_write(9'h006, {24'd0, words[image_at + 12][7:0]});
            bus_write(9'h007, words[image_at + 13]);
            load_image(3'd0);
            bus_write(9'h007, words[image_at + 13] + 32'd1);
            load_image(3'd7);
            bus_write(9'h007, words[image_at + 13]);
            bus_write(9'h006, {24'd0, words[image_at + 12][7:0] ^ 8'd1});
            load_image(3'd7);
            bus_write(9'h006, {24'd0, words[image_at + 12][7:0]});
            for (n = 0; n < 8; n = n + 1) begin
                bus_write(9'h008 + n[8:0], words[image_at + 4 + n] ^ 32'h01000000);
                load_image(3'd7);
                bus_write(9'h008 + n[8:0], words[image_at + 4 + n]);
            end
            load_image(3'd0);
            bus_write(9'h006, 32'd0);
        end
    endtask

    task step;
        begin
            for (i = 0; i < 8; i = i + 1)
                in[i] = words[at + 1 + i];
            for (i = 0; i < 7; i = i + 1)
                out[i] = 32'd0;
            case (words[at])
                32'd0: power_on;
                32'd1: update;
                32'd2: run;
                32'd3: advance;
                32'd4: skip;
                32'd5: begin
                    command(32'd4);
                    read_status;
                    with_state;
                end
                32'd6: begin
                    command(32'd2);
                    read_status;
                    with_state;
                end
                default: begin
                    $display("FAILED: record %0d: no operation %0d", record, words[at]);
                    failed = 1'b1;
                end
            endcase
            for (i = 0; i < 7; i = i + 1)
                if (!failed && out[i] !== words[at + 9 + i]) begin
                    $display("FAILED: record %0d, output %0d: %h, the vectors say %h", record, i, out[i], words[at + 9 + i]);
                    failed = 1'b1;
                end
            at = at + 16;
        end
    endtask

    // A vector file, or an image alone.
    task section;
        begin
            image_words = (words[at + 2] + 3) / 4;
            image_at = at + 4;
            records = words[at + 1] == 32'd1 ? words[at + 3] : 32'd0;
            if (records > limit)
                records = limit;
            sections = sections + 1;
            load_image(words[at + 1] == 32'd1 ? 3'd0 : words[at + 3][2:0]);
            if (words[at + 1] == 32'd6)
                faults = faults + (words[at + 3] != 32'd0 ? 1 : 0);
            spoiled_write;
            at = image_at + image_words;
            for (record = 0; record < records && !failed; record = record + 1) begin
                step;
                if (record % 3 == 0)
                    drain;
            end
            if (!failed) begin
                bus_read(9'h004);
                if (answer !== refusals) begin
                    $display("FAILED: section %0d: %0d ticks were refused, the register says %0d", sections, refusals, answer);
                    failed = 1'b1;
                end
            end
        end
    endtask

    initial begin
        failed = 1'b0;
        started = 1'b0;
        {at, ticks, longest, refusals, sections, faults, record} = 224'd0;
        ready_early = 0;
        {total, taken, number_before, totals[0]} = 128'd0;
        {drained, longer} = 64'd0;
        if (!$value$plusargs("vectors=%s", name)) begin
            $display("FAILED: +vectors=FILE is missing");
            $finish;
        end
        if (!$value$plusargs("records=%d", limit))
            limit = MOST_WORDS;
        $readmemh(name, words);
        repeat (3) @(negedge clk);
        rst = 1'b0;
        bus_write(9'h020, LENGTH);
        bus_write(9'h021, 32'd1);
        while (at < MOST_WORDS && words[at] === 32'h5a67ac01 && (words[at + 1] === 32'd1 || words[at + 1] === 32'd6) && !failed)
            section;
        // At the end of the vectors: a power-on, an update without samples, and a period with room for four ticks.
        early = 1'b0;
        if (!failed && ticks > 0) begin
            power_on;
            bus_write(9'h014, 32'd0);
            while (due && clocks < 100000) begin
                @(negedge clk);
                clocks = clocks + 1;
            end
            read_left;
            early = left >= 4;
            if (early) begin
                too_early;
`ifndef PRESET
                other_unit;
`endif
            end
        end
        if (!failed && ticks > 100 && drained == 0) begin
            $display("FAILED: no increments of %0d ticks", ticks);
            failed = 1'b1;
        end
        if (!failed && ticks == 0 && faults == 0) begin
            $display("FAILED: nothing was run: not a vector file of the compensator");
            failed = 1'b1;
        end
        if (!failed)
            $display("PASSED: images loaded %0d, refused %0d; %0d ticks; %0d increments; %0d updates ready early; slow path %0d clocks at most%0s%0s",
                     sections - faults, faults, ticks, drained, ready_early, longest, early ? "; early ticks refused" : "",
                     longer > 0 ? "; increments waited for room" : "");
        $finish;
    end
endmodule

`default_nettype wire
