//! `sagnac export`: turns a calibration into the files of a target.

use std::collections::BTreeMap;
use std::io::Read;
use std::path::{Path, PathBuf};

use clap::ValueEnum;
use sagnac::calibration::{Calibration, InputSource, UNASSIGNED};
use sagnac::export::{codes, data_sheet, encode, image_bytes};
use sagnac::{Error, Result};
use sagnac_board::{Commit, Message};
use sagnac_core::{Image, SignatureBlock};
use sagnac_log::ingest::{hex, sha256};
use sagnac_log::write::write_bytes;
use sagnac_loops::{LoopTable, TABLE_MAGIC};
use sagnac_ports::{FixedBias, Part, TextFile, c_files, verilog_files};
use sagnac_sim::LoopDesign;

use crate::args::signature::SignArgs;
use crate::files::Files;
use crate::files::loading::{self, FileKind};
use crate::output::console::{Console, Outcome, Ran};
use crate::output::terminal::table as drawn;
use crate::verbs::line::send::frame_bytes;
use crate::verbs::verb::Verb;

/// Write a calibration for the target: one flash image per axis, C99, or Verilog
#[derive(clap::Args)]
#[command(
    after_help = "\
Examples:
  sagnac export unit.cal.json --to image -o unit.img        (three axes: unit-x.img, unit-y.img, unit-z.img)
  sagnac export unit.cal.json --to c -o src/sagnac --loops gyro.toml",
    after_long_help = "\
Examples:
  sagnac export unit.cal.json --to image -o unit.img        (three axes: unit-x.img, unit-y.img, unit-z.img)
  sagnac export unit.cal.json --to c -o src/sagnac --loops gyro.toml
  sagnac export x.cal.json y.cal.json z.cal.json --to c -o src/sagnac
  sagnac export unit.img --to verilog -o rtl
  sagnac export unit.cal.json --to upload --sequence 2 --trial -o /dev/ttyUSB0
  sagnac export unit.cal.json --to image --sign factory.key --model RLG-28 --counter 12 -o unit.img
  sagnac export unit.cal.json --to data-sheet -o unit.md
  sagnac export gyro.toml --to loops -o gyro.loops"
)]
pub(crate) struct Args {
    /// Calibrations, flash images or reference vectors, each axis once; for `--to loops`, the scenario with the loops
    #[arg(value_name = "INPUT", required = true)]
    inputs: Vec<PathBuf>,
    /// Form of the output
    #[arg(long, value_enum)]
    to: Target,
    /// Output file; a folder for C and Verilog
    #[arg(short, long, value_name = "PATH")]
    output: PathBuf,
    /// Sequence number of the image, higher than the one in the gyro [default: 1]
    #[arg(long, value_parser = clap::value_parser!(u32).range(1..))]
    sequence: Option<u32>,
    #[command(flatten)]
    signature: SignArgs,
    /// Upload: store the image on trial. The gyro withdraws it after four starts without `sagnac line send confirm`
    #[arg(long)]
    trial: bool,
    /// C and Verilog: also write the loops of this scenario or loop table
    #[arg(long, value_name = "FILE")]
    loops: Option<PathBuf>,
    /// C: parts around the correction; all four bring the reference vectors and a Makefile too
    #[arg(long, value_enum, value_delimiter = ',', value_name = "PARTS")]
    with: Vec<CPart>,
}

/// A part of the program in C.
#[derive(Clone, Copy, PartialEq, Eq, ValueEnum)]
enum CPart {
    /// Order of a tick, dither, watches
    Board,
    /// Path-length and intensity control
    Loops,
    /// Flash banks and signatures
    Banks,
    /// Serial line and uploads
    Line,
}

impl CPart {
    fn of_ports(self) -> Part {
        match self {
            Self::Board => Part::Board,
            Self::Loops => Part::Loops,
            Self::Banks => Part::Banks,
            Self::Line => Part::Line,
        }
    }
}

/// What an export writes.
#[derive(Clone, Copy, PartialEq, Eq, ValueEnum)]
enum Target {
    /// Flash image (docs/reference/image-format.md)
    Image,
    /// C99 sources (docs/explanation/on-target.md)
    C,
    /// Verilog-2005 sources (docs/explanation/fpga.md)
    Verilog,
    /// Table of the control loops (docs/reference/loop-table.md)
    Loops,
    /// Messages that load an image over the serial line (docs/reference/serial-line.md)
    Upload,
    /// Data sheet of the image as a parameter data item, in Markdown (docs/explanation/certification.md)
    DataSheet,
}

impl Verb for Args {
    fn run(&self, console: &mut Console) -> Ran {
        check_flags(self)?;
        match self.to {
            Target::Image | Target::Upload => per_axis(self, console),
            Target::DataSheet => data_sheets(self, console),
            Target::Loops => {
                files(self).writes([&self.output]).check()?;
                let [input] = self.inputs.as_slice() else {
                    return Err(Error::input("one gyro has one table of loops", "give one scenario or table"));
                };
                let table = loops_of(input)?.encode();
                wrote(&self.output, &table, console)
            }
            Target::C => {
                let axes = axes(self)?;
                let parts: Vec<Part> = self.with.iter().map(|part| part.of_ports()).collect();
                let table = table(self, &axes)?;
                let axes: Vec<_> = axes.iter().map(|axis| (axis.image, axis.bias)).collect();
                let files = c_files(&axes, table.as_ref(), &parts);
                folders(self, &[(self.output.clone(), files)], console)
            }
            Target::Verilog => {
                let axes = axes(self)?;
                let table = table(self, &axes)?;
                let exports: Vec<_> = axes
                    .iter()
                    .map(|axis| {
                        let letter = path_letter(char::from(axis.image.description().axis));
                        let path = if axes.len() == 1 { self.output.clone() } else { self.output.join(letter) };
                        (path, verilog_files(&axis.image, table.as_ref()))
                    })
                    .collect();
                folders(self, &exports, console)
            }
        }
    }
}

/// What every export reads.
fn files(args: &Args) -> Files {
    Files::new().reads(&args.inputs).reads(&args.loops).reads(&args.signature.sign)
}

/// Writes the sources, after a look at all of their names.
fn folders(args: &Args, exports: &[(PathBuf, Vec<TextFile>)], console: &mut Console) -> Ran {
    let names = exports.iter().flat_map(|(path, files)| files.iter().map(|file| path.join(&file.name)));
    files(args).writes(names).makes(exports.iter().map(|(path, _)| path)).check()?;
    let mut places = exports.iter().flat_map(|(path, files)| files.iter().map(|file| (path.join(&file.name), file)));
    if let Some((path, _)) = places.find(|(path, file)| !file.may_replace(path)) {
        return Err(Error::input(
            "the export would overwrite a file that another program wrote",
            "export into an empty folder: -o NEW-FOLDER",
        )
        .file(path.display().to_string()));
    }
    for (path, files) in exports {
        folder(path, files, console)?;
    }
    say_codes(args, console)?;
    Ok(Outcome::Done)
}

/// Refuses a flag that the target does not use.
fn check_flags(args: &Args) -> Result<()> {
    use Target::{C, DataSheet, Image, Upload, Verilog};
    let said =
        [("--model", args.signature.block.model.is_some()), ("--counter", args.signature.block.counter.is_some())];
    if let Some((flag, _)) = said.iter().find(|(_, given)| *given && args.signature.sign.is_none()) {
        return Err(Error::input("applies only with --sign", "add --sign KEY, or remove it").column(*flag));
    }
    let flags: [(&str, bool, &[Target]); 5] = [
        ("--sign", args.signature.sign.is_some(), &[Image, Upload]),
        ("--trial", args.trial, &[Upload]),
        ("--sequence", args.sequence.is_some(), &[Image, Upload, C, Verilog, DataSheet]),
        ("--loops", args.loops.is_some(), &[C, Verilog]),
        ("--with", !args.with.is_empty(), &[C]),
    ];
    match flags.iter().find(|(_, given, targets)| *given && !targets.contains(&args.to)) {
        None => Ok(()),
        Some((name, _, targets)) => {
            let names: Vec<&str> = targets.iter().map(|target| target.name()).collect();
            Err(Error::input(
                format!("applies only to --to {}", names.join(", --to ")),
                format!("remove {name}, or change --to"),
            )
            .column(*name))
        }
    }
}

impl Target {
    fn name(self) -> &'static str {
        match self {
            Self::Image => "image",
            Self::C => "c",
            Self::Verilog => "verilog",
            Self::Loops => "loops",
            Self::Upload => "upload",
            Self::DataSheet => "data-sheet",
        }
    }
}

fn per_axis(args: &Args, console: &mut Console) -> Ran {
    // All images first: a failure of the second axis leaves the first axis' old file.
    let axes = axes(args)?;
    let path_of = |axis: &UnitAxis| path_of(args, axes.len(), &axis.image);
    files(args).writes(axes.iter().map(path_of)).check()?;
    for axis in &axes {
        let (path, image) = (path_of(axis), &axis.image);
        let mut bytes = image_bytes(image);
        let block = args.signature.block_of(&bytes)?.or(axis.signed_before);
        bytes.extend(block.iter().flat_map(|block| block.encode()));
        let bytes =
            if args.to == Target::Upload { upload(&bytes, image.description().axis, args.trial)? } else { bytes };
        wrote(&path, &bytes, console)?;
    }
    say_codes(args, console)?;
    Ok(Outcome::Done)
}

/// A sheet for each axis; only a calibration has an error budget.
fn data_sheets(args: &Args, console: &mut Console) -> Ran {
    for input in &args.inputs {
        if !matches!(loading::kind_of(input)?, FileKind::Calibration) {
            return Err(Error::input(
                "a data sheet needs a calibration, and this is an image",
                "give the calibration of this image",
            )
            .file(input.display().to_string()));
        }
    }
    let axes = axes(args)?;
    let path_of = |axis: &UnitAxis| path_of(args, axes.len(), &axis.image);
    files(args).writes(axes.iter().map(path_of)).check()?;
    let mut all = axes.iter();
    for input in &args.inputs {
        let calibration = calibration(input)?;
        for (record, axis) in calibration.axes.iter().zip(&mut all) {
            wrote(&path_of(axis), data_sheet(&calibration, record, &axis.image).as_bytes(), console)?;
        }
    }
    Ok(Outcome::Done)
}

/// The output, or one for each axis.
fn path_of(args: &Args, axes: usize, image: &Image) -> PathBuf {
    match axes {
        1 => args.output.clone(),
        _ => path_of_axis(&args.output, char::from(image.description().axis)),
    }
}

/// What the target gives the image at each slow update, where it is more than one thermometer's code.
fn say_codes(args: &Args, console: &mut Console) -> Result<()> {
    args.inputs.iter().try_for_each(|input| say_codes_of(input, console))
}

fn say_codes_of(input: &Path, console: &mut Console) -> Result<()> {
    if !matches!(loading::kind_of(input)?, FileKind::Calibration) {
        return Ok(());
    }
    let calibration = loading::calibration(input)?;
    for axis in calibration.axes.iter().filter(|axis| !axis.other_inputs().is_empty()) {
        let rows = codes(axis).into_iter().enumerate().map(|(at, code)| {
            let fed = code.per_code.map_or("none: made on the target".to_owned(), |per_code| {
                format!("(value - {}) / {per_code:e}", code.offset)
            });
            vec![at.to_string(), code.name, fed]
        });
        let title = format!("input of axis {}", axis.axis);
        console.say(drawn(&["place", &title, "code"], rows));
        let data_given = axis.other_inputs().iter().filter(|input| {
            matches!(&input.source, InputSource::Column(name) if calibration.setup.aux(name).gain_per_code.is_none())
        });
        for input in data_given {
            console.note(format!(
                "note: the code of {} depends on the span of this fit. Set gain_per_code under [[aux]] to fix it",
                input.name
            ));
        }
    }
    Ok(())
}

/// One axis of the export.
struct UnitAxis {
    image: Image,
    bias: FixedBias,
    /// The signature of an image that is exported again: it stays, for the image does.
    signed_before: Option<SignatureBlock>,
}

/// The pieces of an image and the word to commit it, to the gyro of its axis.
fn upload(image: &[u8], axis: u8, trial: bool) -> Result<Vec<u8>> {
    let commit = Message::Commit(Commit { len: image.len() as u16, trial });
    let frames: Result<Vec<_>> =
        Message::pieces(image).chain([commit]).map(|message| frame_bytes(&message, axis)).collect();
    Ok(frames?.concat())
}

/// The axes of all inputs, in their order.
fn axes(args: &Args) -> Result<Vec<UnitAxis>> {
    let mut all: Vec<UnitAxis> = Vec::new();
    for input in &args.inputs {
        for axis in axes_of(args, input)? {
            let letter = axis.image.description().axis;
            let refused = |what: &str, help: &str, value: String| {
                Err(Error::input(what, help).file(input.display().to_string()).value(value))
            };
            // Their constants, and their address on the line, are the same.
            if all.iter().any(|before| before.image.description().axis.eq_ignore_ascii_case(&letter)) {
                return refused("another input has this axis", "give each axis once", char::from(letter).to_string());
            }
            let tick_ns = axis.image.description().tick_ns;
            if all.iter().any(|before| before.image.description().tick_ns != tick_ns) {
                let help = "calibrate all axes with one tick_s, or export them apart";
                return refused("another input has another tick", help, format!("{tick_ns} ns"));
            }
            all.push(axis);
        }
    }
    Ok(all)
}

/// The axes of a calibration, or the one of an image.
fn axes_of(args: &Args, input: &Path) -> Result<Vec<UnitAxis>> {
    let named = |e: Error| e.file(input.display().to_string());
    match loading::kind_of(input)? {
        FileKind::Image if args.sequence.is_some() => {
            Err(Error::input("an image has a sequence number already", "export the calibration again with --sequence")
                .column("--sequence"))
        }
        FileKind::Image => {
            let (image, signed_before) = (loading::image(input)?, loading::signed_image(input)?.2);
            if signed_before.is_some() && args.signature.sign.is_some() {
                return Err(named(Error::input(
                    "the image is signed already",
                    "sign the calibration's own export: sagnac export unit.cal.json --sign KEY",
                )));
            }
            Ok(vec![UnitAxis { image, bias: FixedBias::Unknown, signed_before }])
        }
        FileKind::Log if input.extension().is_some_and(|extension| extension == "hex") => {
            let refused = |e: sagnac_core::DecodeError| {
                named(Error::input(e.to_string(), "copy the vectors again from their source"))
            };
            let image = Image::decode(&table_or_vectors(input)?).map_err(refused)?;
            Ok(vec![UnitAxis { image, bias: FixedBias::Unknown, signed_before: None }])
        }
        _ => {
            let calibration = calibration(input)?;
            let biases = calibration.removed_dph().into_iter().map(FixedBias::of);
            let images = encode_all(&calibration, args.sequence)?.into_iter();
            Ok(images.zip(biases).map(|(image, bias)| UnitAxis { image, bias, signed_before: None }).collect())
        }
    }
}

fn encode_all(calibration: &Calibration, sequence: Option<u32>) -> Result<Vec<Image>> {
    let parent = sha256(calibration.to_json()?.as_bytes());
    calibration.axes.iter().map(|axis| encode(calibration, axis, parent, sequence.unwrap_or(1))).collect()
}

fn calibration(path: &Path) -> Result<Calibration> {
    let calibration = loading::calibration(path)?;
    if calibration.serial == UNASSIGNED {
        return Err(Error::refused(
            "the calibration has no serial number, and an image belongs to one gyro",
            "calibrate again with --serial IMU-0042",
        )
        .file(path.display().to_string())
        .column("serial"));
    }
    Ok(calibration)
}

/// The loops, for the same tick as the images.
fn table(args: &Args, axes: &[UnitAxis]) -> Result<Option<LoopTable>> {
    let Some(path) = args.loops.as_deref() else { return Ok(None) };
    let table = loops_of(path)?;
    match axes.iter().map(|axis| &axis.image).find(|image| image.description().tick_ns != table.tick_ns) {
        None => Ok(Some(table)),
        Some(image) => Err(Error::input(
            format!(
                "its loops are for a tick of {} ns, the correction for one of {} ns",
                table.tick_ns,
                image.description().tick_ns
            ),
            "give loops and a calibration of the same tick_s",
        )
        .file(path.display().to_string())),
    }
}

/// The table in a file of reference vectors, or the file itself.
fn table_or_vectors(path: &Path) -> Result<Vec<u8>> {
    /// Far beyond any of them.
    const MOST_BYTES: u64 = 16 << 20;
    let file = std::fs::File::open(path).map_err(|e| Error::io_path(path, "open", &e))?;
    let mut bytes = Vec::new();
    file.take(MOST_BYTES).read_to_end(&mut bytes).map_err(|e| Error::io_path(path, "read", &e))?;
    let mut words = sagnac_vectors::Words::new(&bytes);
    let Ok(head) = words.head() else { return Ok(bytes) };
    let mut room = [0; sagnac_vectors::MAX_TABLE];
    let table = words.table(&head, &mut room);
    Ok(table
        .map_err(|e| {
            Error::input(e.to_string(), "copy the vectors again from their source").file(path.display().to_string())
        })?
        .to_vec())
}

/// The loops of a table, of reference vectors, or of a scenario.
fn loops_of(path: &Path) -> Result<LoopTable> {
    let bytes = table_or_vectors(path)?;
    if bytes.starts_with(&TABLE_MAGIC) {
        let refused = |e: sagnac_loops::TableError| {
            Error::input(e.to_string(), "copy the table again from its source").file(path.display().to_string())
        };
        return LoopTable::decode(&bytes).map_err(refused);
    }
    let design =
        LoopDesign::build(&loading::scenario(path)?).map_err(|problem| loading::scenario_refused(path, &problem))?;
    Ok(LoopTable {
        tick_ns: (sagnac_sim::TICK_S * 1e9).round() as u32,
        path_length: design.path_length.integers,
        intensity: design.intensity.integers,
    })
}

fn folder(path: &Path, files: &[TextFile], console: &mut Console) -> Ran {
    std::fs::create_dir_all(path).map_err(|e| Error::io_path(path, "create", &e))?;
    for file in files {
        let file_path = path.join(&file.name);
        if let Some(below) = file_path.parent() {
            std::fs::create_dir_all(below).map_err(|e| Error::io_path(below, "create", &e))?;
        }
        write_bytes(&file_path, file.text.as_bytes())?;
    }
    console.say(format!("wrote {}: {}", path.display(), listed(files).join(", ")));
    Ok(Outcome::Done)
}

/// The names of the files; of a folder its name and how many it has.
fn listed(files: &[TextFile]) -> Vec<String> {
    let mut names: Vec<String> = Vec::new();
    let mut folders: BTreeMap<&str, usize> = BTreeMap::new();
    for file in files {
        match file.name.split_once('/') {
            Some((folder, _)) => *folders.entry(folder).or_default() += 1,
            None => names.push(file.name.clone()),
        }
    }
    names.extend(folders.into_iter().map(|(folder, count)| format!("{folder}/ ({count})")));
    names
}

fn wrote(path: &Path, bytes: &[u8], console: &mut Console) -> Ran {
    write_bytes(path, bytes)?;
    console.say(format!("wrote {}: {} bytes, SHA-256 {}", path.display(), bytes.len(), hex(&sha256(bytes))));
    Ok(Outcome::Done)
}

/// An axis as part of a file name: other characters than letters and digits become their number, so that the file stays in
/// its folder.
fn path_letter(axis: char) -> String {
    if axis.is_ascii_alphanumeric() { axis.to_string() } else { format!("{:02x}", u32::from(axis)) }
}

/// `unit.img` becomes `unit-x.img`.
fn path_of_axis(path: &Path, axis: char) -> PathBuf {
    let axis = path_letter(axis);
    let stem = path.file_stem().map(|s| s.to_string_lossy().into_owned()).unwrap_or_default();
    let name = match path.extension() {
        Some(extension) => format!("{stem}-{axis}.{}", extension.to_string_lossy()),
        None => format!("{stem}-{axis}"),
    };
    path.with_file_name(name)
}
