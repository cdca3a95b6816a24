//! The corpus of broken inputs: the files of each case, the command that runs on them, and the expected result.

mod crafted;
mod documents;
mod noise;

use std::io::Write;
use std::os::unix::fs::PermissionsExt;
use std::path::Path;
use std::sync::Arc;

use anyhow::Result;
use arrow_array::{ArrayRef, BooleanArray, Float64Array, Int64Array, RecordBatch};
use arrow_ipc::writer::{FileWriter, StreamWriter};
use arrow_schema::{Field, Schema};
use flate2::Compression;
use flate2::write::GzEncoder;
use parquet::arrow::ArrowWriter;
use sagnac_sim::{PaperRig, csv_bytes};
use tempfile::TempDir;

use crate::program::Program;

/// Standard input of a case.
pub(crate) enum Feed {
    Nothing,
    /// A block and its number of repetitions.
    Endless(Vec<u8>, usize),
}

/// One broken input.
pub(crate) struct Case {
    pub(crate) name: &'static str,
    pub(crate) args: Vec<&'static str>,
    pub(crate) status: i32,
    /// Text that the message must contain.
    pub(crate) place: Option<&'static str>,
    pub(crate) stdin: Feed,
    pub(crate) as_nobody: bool,
    /// The message is that of the argument parser, in its own format.
    pub(crate) usage: bool,
    files: Vec<(&'static str, Vec<u8>)>,
    /// Last step of preparing the folder.
    then: Option<Then>,
}

type Then = Box<dyn Fn(&Path) -> Result<()>>;

impl Case {
    pub(crate) fn make(&self, folder: &Path) -> Result<()> {
        for (name, bytes) in &self.files {
            std::fs::write(folder.join(name), bytes)?;
        }
        self.then.as_ref().map_or(Ok(()), |then| then(folder))
    }

    fn file(mut self, name: &'static str, bytes: impl Into<Vec<u8>>) -> Self {
        self.files.push((name, bytes.into()));
        self
    }

    fn place(mut self, place: &'static str) -> Self {
        self.place = Some(place);
        self
    }

    fn refused(mut self) -> Self {
        self.status = 3;
        self
    }

    fn then(mut self, then: impl Fn(&Path) -> Result<()> + 'static) -> Self {
        self.then = Some(Box::new(then));
        self
    }
}

fn case(name: &'static str, args: &'static str) -> Case {
    let args = split(args);
    Case {
        name,
        args,
        status: 2,
        place: None,
        stdin: Feed::Nothing,
        as_nobody: false,
        usage: false,
        files: vec![],
        then: None,
    }
}

/// Splits into words; text between `'` is one word.
fn split(args: &'static str) -> Vec<&'static str> {
    let parts = args.split('\'').enumerate();
    parts.flat_map(|(i, part)| if i % 2 == 1 { vec![part] } else { part.split_whitespace().collect() }).collect()
}

const CALIBRATE: &str = "calibrate log.csv --arcsec-per-count 1.059 --quantum 0.25 -o out.json";

/// A case of calibrate on one log.
fn log(name: &'static str, text: impl Into<Vec<u8>>) -> Case {
    case(name, CALIBRATE).file("log.csv", text).place("log.csv")
}

/// The paper's run, a good log.
fn good() -> String {
    String::from_utf8(csv_bytes(PaperRig::PAPER.run(1))).unwrap()
}

/// The good log with its fields changed, row by row (the first is 0).
fn changed(change: impl Fn(usize, &mut Vec<String>)) -> String {
    let text = good();
    let mut lines = text.lines();
    let mut out = lines.next().unwrap().to_owned() + "\n";
    for (i, line) in lines.enumerate() {
        let mut fields = line.split(',').map(str::to_owned).collect();
        change(i, &mut fields);
        out += &(fields.join(",") + "\n");
    }
    out
}

fn header(header: &str) -> String {
    let text = good();
    format!("{header}\n{}", text.split_once('\n').unwrap().1)
}

fn noise(length: usize) -> Vec<u8> {
    let mut state = 0x9e37_79b9_7f4a_7c15_u64;
    let mut next = || {
        state ^= state << 13;
        state ^= state >> 7;
        state ^= state << 17;
        (state >> 24) as u8
    };
    (0..length).map(|_| next()).collect()
}

pub(crate) fn gzip(bytes: &[u8]) -> Vec<u8> {
    let mut out = GzEncoder::new(Vec::new(), Compression::fast());
    out.write_all(bytes).unwrap();
    out.finish().unwrap()
}

fn cut(mut bytes: Vec<u8>, part: f64) -> Vec<u8> {
    bytes.truncate((bytes.len() as f64 * part) as usize);
    bytes
}

fn batch() -> RecordBatch {
    let rows: Vec<_> = PaperRig::PAPER.run(1).collect();
    let columns: Vec<(&str, ArrayRef)> = vec![
        ("time_s", Arc::new(Float64Array::from_iter_values(rows.iter().map(|r| r.time_s)))),
        ("temperature_c", Arc::new(Float64Array::from_iter_values(rows.iter().map(|r| r.temperature_c)))),
        ("counts", Arc::new(Float64Array::from_iter_values(rows.iter().map(|r| r.counts)))),
    ];
    of_columns(columns)
}

fn of_columns(columns: Vec<(&str, ArrayRef)>) -> RecordBatch {
    let fields: Vec<Field> = columns.iter().map(|(n, c)| Field::new(*n, c.data_type().clone(), true)).collect();
    RecordBatch::try_new(Arc::new(Schema::new(fields)), columns.into_iter().map(|(_, c)| c).collect()).unwrap()
}

fn parquet(batch: &RecordBatch) -> Vec<u8> {
    let mut bytes = Vec::new();
    let mut writer = ArrowWriter::try_new(&mut bytes, batch.schema(), None).unwrap();
    writer.write(batch).unwrap();
    writer.close().unwrap();
    bytes
}

fn arrow_file() -> Vec<u8> {
    let mut writer = FileWriter::try_new(Vec::new(), &batch().schema()).unwrap();
    writer.write(&batch()).unwrap();
    writer.into_inner().unwrap()
}

fn arrow_stream() -> Vec<u8> {
    let mut writer = StreamWriter::try_new(Vec::new(), &batch().schema()).unwrap();
    writer.write(&batch()).unwrap();
    writer.into_inner().unwrap()
}

/// Header and flag bits, then messages.
fn ulog(messages: &[(u8, &[u8])]) -> Vec<u8> {
    let mut bytes = vec![0x55, 0x4c, 0x6f, 0x67, 0x01, 0x12, 0x35, 1, 0, 0, 0, 0, 0, 0, 0, 0];
    for (kind, payload) in [&[(b'B', &[0_u8; 40][..])], messages].concat() {
        bytes.extend_from_slice(&(payload.len() as u16).to_le_bytes());
        bytes.push(kind);
        bytes.extend_from_slice(payload);
    }
    bytes
}

const BENCH: &str = "arcsec_per_count = 1.059\nquantum = 0.25\nserial = \"PAPER-RIG\"\n";

/// Output of the program: a calibration and its image.
struct Good {
    record: String,
    image: Vec<u8>,
}

impl Good {
    fn new(program: &Program) -> Result<Self> {
        let folder = TempDir::new()?;
        let file = |name: &str| folder.path().join(name);
        std::fs::write(file("log.csv"), good())?;
        std::fs::write(file("bench.toml"), BENCH)?;
        let args = ["calibrate", "log.csv", "--setup", "bench.toml", "--model", "bias 2", "-o", "unit.cal.json"];
        program.stdout_in(folder.path(), &args)?;
        program.stdout_in(folder.path(), &["export", "unit.cal.json", "--to", "image", "-o", "unit.img"])?;
        let (record, image) = (std::fs::read_to_string(file("unit.cal.json"))?, std::fs::read(file("unit.img"))?);
        Ok(Self { record, image })
    }
}

fn with_byte(bytes: &[u8], at: usize, byte: u8) -> Vec<u8> {
    let mut bytes = bytes.to_vec();
    bytes[at] = byte;
    bytes
}

/// All cases. The program makes the good records, which the cases damage.
pub(crate) fn cases(program: &Program) -> Result<Vec<Case>> {
    let good = Good::new(program)?;
    let mut all = text_logs();
    all.extend(values_of_logs());
    all.extend(binary_logs());
    all.extend(documents::setups(&good));
    all.extend(documents::scenarios());
    all.extend(models_and_data());
    all.extend(files(&good));
    all.extend(documents::records(&good)?);
    all.extend(noise::noise_budgets(&good));
    all.extend(crafted::crafted(&good)?);
    Ok(all)
}

/// A case for tests: status 2, names log.csv.
#[cfg(test)]
pub(crate) fn example() -> Case {
    log("example", "")
}

fn text_logs() -> Vec<Case> {
    let mut endless = case("a gigabyte without a newline", "calibrate - --arcsec-per-count 1 -o out.json");
    endless.stdin = Feed::Endless(vec![b'7'; 1 << 20], 1024);
    let mut after_header =
        case("a gigabyte without a newline below a header", "calibrate - --arcsec-per-count 1 -o out.json");
    after_header.stdin = Feed::Endless([b"time_s,counts\n1,".to_vec(), vec![b'7'; 3 << 20]].concat(), 341);
    vec![
        log("empty file", ""),
        log("header only", "time_s,temperature_c,counts\n"),
        log("only comments", "# one\n# two\n"),
        log("a single row", "time_s,temperature_c,counts\n1,20,5\n"),
        log("numbers instead of headers", good().split_once('\n').unwrap().1),
        log("binary noise", noise(100_000)),
        log("zero bytes", vec![0_u8; 5000]),
        endless,
        after_header,
        log("truncated gzip", cut(gzip(good().as_bytes()), 0.6)),
        log("gzip with a wrong checksum", {
            let mut bytes = gzip(good().as_bytes());
            let at = bytes.len() - 7;
            bytes[at] ^= 0x55;
            bytes
        }),
        log("gzip of noise", gzip(&noise(9000))),
        log("mixed delimiters", good().replacen("time_s,temperature_c,counts", "time_s;temperature_c;counts", 1)),
        log("every row ragged", changed(|_, fields| fields.push("7".to_owned()))),
        log("unknown unit of temperature", header("time_s,temperature_f,counts")).place("temperature_f"),
        log("unknown unit of time", header("time_h,temperature_c,counts")).place("time_h"),
        log("unknown unit of rate", header("time_s,temperature_c,rate_rpm")).place("rate_rpm"),
        log("duplicate headers", header("time_s,counts,counts")).place("counts"),
        log("two thermometers of one name", header("temperature_k,temperature_c,counts")).place("temperature_c"),
        log("two time columns", header("time_s,time_ms,counts")).place("time_ms"),
        log("axis of two letters", header("time_s,temperature_c,counts_roll")).place("counts_roll"),
        log("no counts and no rates", header("time_s,temperature_c,volts")),
        log("its own corrected output", format!("# sagnac compensated: serial X, images 0\n{}", good())).refused(),
        log("its own corrected output without the stamp", header("time_s,temperature_c,compensated_counts")).refused(),
    ]
}

fn values_of_logs() -> Vec<Case> {
    let field = |index: usize, value: &'static str| changed(move |_, fields| fields[index] = value.to_owned());
    let cumulative = "calibrate log.csv --arcsec-per-count 1.059 --counter cumulative -o out.json";
    let total = |wrap: i64| changed(move |i, fields| fields[2] = ((i as i64 * 43) % wrap).to_string());
    let wraps =
        case("counter that wraps, of unknown width", cumulative).file("log.csv", total(1 << 12)).place("log.csv:");
    let beyond = case(
        "counter beyond its width",
        "calibrate log.csv --arcsec-per-count 1.059 --counter cumulative --counter-bits 8 -o out.json",
    );
    vec![
        log("counts that are all NaN", field(2, "nan")).refused().place("not_a_number"),
        log("counts that are all infinite", field(2, "inf")).refused().place("not_a_number"),
        log("counts of 1e308", field(2, "1e308")).refused().place("value_out_of_range"),
        log(
            "counts that are no whole quanta",
            changed(|i, f| {
                if i == 999 {
                    f[2] = "4.1".to_owned()
                }
            }),
        )
        .place("log.csv:1001"),
        log("time that does not advance", field(0, "5")),
        log("time that is no number", field(0, "noon")),
        log("time backwards", changed(|i, fields| fields[0] = (20_000 - i).to_string())),
        log(
            "clock set in the middle",
            changed(|i, f| {
                if i > 5000 {
                    f[0] = (4_000_000 + i).to_string()
                }
            }),
        )
        .place("log.csv:5003"),
        log("temperatures that are no numbers", field(1, "warm")).refused(),
        log("temperatures that are all missing", field(1, "")).refused(),
        log("temperatures outside the valid range", field(1, "1200")).refused(),
        log("one temperature", field(1, "25")).refused(),
        log("thermometer off by 100 °C", changed(|_, f| f[1] = (f[1].parse::<f64>().unwrap() + 100.0).to_string()))
            .refused(),
        log(
            "thermometer in the wrong unit",
            changed(|_, f| f[1] = (f[1].parse::<f64>().unwrap() + 273.15).to_string()),
        )
        .refused(),
        log("no temperature", header("time_s,note,counts")).refused().place("temperature"),
        log(
            "every row flagged",
            header("time_s,temperature_c,counts,valid")
                .lines()
                .enumerate()
                .map(|(i, l)| if i == 0 { format!("{l}\n") } else { format!("{l},0\n") })
                .collect::<String>(),
        )
        .refused()
        .place("flagged_invalid"),
        wraps,
        beyond.file("log.csv", total(1 << 20)).place("counter_bits"),
        log("a running total mapped as counts of rows", total(i64::MAX)).place("counter"),
        log("counts that never change", field(2, "4")).refused(),
        case(
            "an input rate of an axis that the log lacks",
            "calibrate log.csv --arcsec-per-count 1.059 --quantum 0.25 --input-rate q=4.5 -o out.json",
        )
        .file("log.csv", good())
        .place("input_rate_dph"),
    ]
}

fn binary_logs() -> Vec<Case> {
    let on = |name: &'static str, bytes: Vec<u8>| log(name, bytes);
    let flat = b"sensor_baro:uint64_t timestamp;float temperature;";
    let gyro = b"sensor_gyro:uint64_t timestamp;float x;float y;float z;float temperature;";
    let wrong_type = of_columns(vec![
        ("time_s", Arc::new(Float64Array::from(vec![1.0, 2.0]))),
        ("counts", Arc::new(BooleanArray::from(vec![true, false]))),
    ]);
    let no_counts = of_columns(vec![("time_s", Arc::new(Int64Array::from(vec![1, 2])))]);
    vec![
        on("truncated Parquet", cut(parquet(&batch()), 0.5)),
        on("Parquet of noise", [b"PAR1".to_vec(), noise(3000), b"PAR1".to_vec()].concat()),
        // The next three were found by fuzzing: a page header and a footer that announce lists of about 10^9 elements, and a
        // dictionary of as many values.
        on("Parquet with a list that never ends", include_bytes!("found/endless-list.parquet").to_vec()),
        on(
            "Parquet with a dictionary larger than its page",
            include_bytes!("found/endless-dictionary.parquet").to_vec(),
        ),
        on("Parquet column of another kind", parquet(&wrong_type)).place("counts"),
        on("Parquet without counts", parquet(&no_counts)),
        on("truncated Arrow file", cut(arrow_file(), 0.5)),
        on("damaged Arrow file", {
            let mut bytes = arrow_file();
            bytes[70..130].fill(0xee);
            bytes
        }),
        on("truncated Arrow stream", cut(arrow_stream(), 0.7)),
        on("Arrow stream that promises too much", {
            let mut bytes = arrow_stream();
            bytes[4..8].copy_from_slice(&i32::MAX.to_le_bytes());
            bytes
        }),
        on("truncated ULog", ulog(&[])[..12].to_vec()),
        on("ULog cut before its data", cut(ulog(&[(b'F', gyro), (b'A', b"\0\x05\0sensor_gyro")]), 0.8)),
        on("ULog without a gyro", ulog(&[(b'F', flat), (b'A', b"\0\x05\0sensor_baro"), (b'D', &[5; 14])]))
            .place("sensor_gyro"),
        on("ULog of noise", [ulog(&[]), noise(4000)].concat()),
    ]
}

fn models_and_data() -> Vec<Case> {
    let fit = |name: &'static str, args: &'static str| case(name, args).file("log.csv", good());
    let short = changed(|_, _| {}).lines().take(700).map(|l| format!("{l}\n")).collect::<String>();
    let mut usage = fit("flag that is no number", "calibrate log.csv --arcsec-per-count one -o out.json");
    usage.usage = true;
    vec![
        fit("counts without a scale factor", "calibrate log.csv -o out.json").place("arcsec_per_count"),
        fit("model that is none", "calibrate log.csv --arcsec-per-count 1 --quantum 0.25 --model cubic -o out.json"),
        fit("model of order 12", "calibrate log.csv --arcsec-per-count 1 --quantum 0.25 --model 'bias 12' -o out.json"),
        fit("scale factor from one rate", "calibrate log.csv --arcsec-per-count 1.059 --quantum 0.25 --model 'bias 2, scale 1' -o out.json").refused(),
        fit("reference outside the span", "calibrate log.csv --arcsec-per-count 1.059 --quantum 0.25 --reference 60 -o out.json").refused().place("reference_c"),
        fit("span too small", "calibrate log.csv --arcsec-per-count 1.059 --quantum 0.25 --min-span 40 -o out.json").refused().place("min_span_c"),
        fit("thermometer that is not there", "calibrate log.csv --arcsec-per-count 1.059 --quantum 0.25 --thermometer mirror -o out.json").place("mirror"),
        fit("the same log twice", "calibrate log.csv log.csv --arcsec-per-count 1.059 --quantum 0.25 -o out.json"),
        fit("logs of different columns", "calibrate log.csv other.csv --arcsec-per-count 1.059 --quantum 0.25 -o out.json")
            .file("other.csv", header("time_s,temperature_c_block,counts")).place("other.csv"),
        case("too few windows", "calibrate log.csv --arcsec-per-count 1.059 --quantum 0.25 --min-span 0.2 --reference 18 --model 'bias 3, rate 1' -o out.json").file("log.csv", short).refused(),
        fit("rows without time or interval", "calibrate log.csv --arcsec-per-count 1 -o out.json")
            .file("log.csv", header("second,temperature_c,counts")).place("sample_interval_s"),
        usage,
        case("polynomial that is none", "import --polynomial 1,x --window 100 --span 10,30 --arcsec-per-count 1 -o out.json").place("1,x"),
        case("span from high to low", "import --polynomial 1,2 --window 100 --span 30,10 --arcsec-per-count 1 -o out.json"),
    ]
}

fn files(by: &Good) -> Vec<Case> {
    let on = |name: &'static str, args: &'static str| case(name, args).file("log.csv", good());
    // Without an output: in this folder nobody may write, and that is tried first.
    let reading = "calibrate log.csv --arcsec-per-count 1.059 --quantum 0.25";
    let mut unreadable = case("log that may not be read", reading).file("log.csv", good()).place("log.csv");
    unreadable.as_nobody = true;
    let lock =
        |folder: &Path| Ok(std::fs::set_permissions(folder.join("log.csv"), std::fs::Permissions::from_mode(0o000))?);
    let mut unwritable = on("folder that may not be written", CALIBRATE).place("out.json");
    unwritable.as_nobody = true;
    vec![
        case("log that is not there", CALIBRATE).place("log.csv"),
        log("directory for a log", "").then(|folder| {
            std::fs::remove_file(folder.join("log.csv"))?;
            Ok(std::fs::create_dir(folder.join("log.csv"))?)
        }),
        unreadable.then(lock),
        unwritable,
        on(
            "output in a folder that is not there",
            "calibrate log.csv --arcsec-per-count 1.059 --quantum 0.25 -o no/unit.json",
        )
        .place("no/unit.json"),
        on("output that is a directory", "calibrate log.csv --arcsec-per-count 1.059 --quantum 0.25 -o folder")
            .then(|folder| Ok(std::fs::create_dir(folder.join("folder"))?))
            .place("folder"),
        on("disk full", "calibrate log.csv --arcsec-per-count 1.059 --quantum 0.25 -o /dev/full").place("/dev/full"),
        on("report on a full disk", "calibrate log.csv --arcsec-per-count 1.059 --quantum 0.25 --report /dev/full")
            .place("/dev/full"),
        on("table on a full disk", "inspect log.csv --arcsec-per-count 1.059 --quantum 0.25 --windows /dev/full")
            .place("/dev/full"),
        case("corrected log on a full disk", "compensate unit.cal.json log.csv -o /dev/full")
            .file("log.csv", good())
            .file("unit.cal.json", by.record.as_str()),
    ]
}

/// An image with the CRC of its bytes.
pub(crate) fn recrc(mut bytes: Vec<u8>) -> Vec<u8> {
    let end = bytes.len().saturating_sub(4);
    let crc = crc32(&bytes[..end]);
    bytes[end..].copy_from_slice(&crc.to_le_bytes());
    bytes
}

/// CRC-32 of IEEE 802.3, as docs/reference/image-format.md has it.
fn crc32(bytes: &[u8]) -> u32 {
    let mut crc = flate2::Crc::new();
    crc.update(bytes);
    crc.sum()
}
