//! What a firmware team builds first: the export with CMake and as a Zephyr module, and its example of a board with three axes.
//!
//! Zephyr itself is not on this machine: its three functions for a module's library are replaced by those of CMake, so that only the
//! module's own lines are tried.

use std::fs;
use std::io::{BufReader, Read, Write};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};

use anyhow::{Context, Result, ensure};
use sagnac_board::frame::{Frame, FrameReader};
use sagnac_board::{Commit, Message, OutputFrame, ReplyCode};
use sagnac_core::{Description, Image, Origin, Status, UNBOUNDED};
use sagnac_ports::{FixedBias, Part, c_files};
use xtask::shell::{stdout_of, text};

use crate::targets::vector_files::{image, loops, write};

const AXES: [u8; 3] = *b"xyz";
/// Frames of each axis after the new image runs.
const FRAMES: usize = 300;
/// Longer than all of them.
const MOST_BYTES: usize = 4 << 20;

/// In a folder of its own: the modules of the other checks have one axis.
pub(super) fn all(folder: &Path) -> Result<()> {
    let three = folder.join("three");
    let images = AXES.map(of_axis).into_iter().collect::<Result<Vec<_>>>()?;
    let axes: Vec<_> = images.iter().map(|image| (*image, FixedBias::Unknown)).collect();
    write(&three, &c_files(&axes, Some(&loops()?), &Part::ALL))?;
    cmake(&three)?;
    zephyr(&three)?;
    let program = example(&three)?;
    let newer = Image::new(Description { sequence: 7, ..*images[1].description() })?;
    on_the_board(&program, &newer)
}

fn of_axis(axis: u8) -> Result<Image> {
    Ok(Image::new(Description { axis, ..*image("compensator-paper")?.description() })?)
}

/// The library and the check of the constants, of all axes.
fn cmake(folder: &Path) -> Result<()> {
    let flags = "-DCMAKE_C_FLAGS=-Wall -Wextra -Wpedantic -Wconversion -Wshadow -Werror";
    stdout_of(120, "cmake", &["-S", ".", "-B", "build", flags], folder)?;
    stdout_of(300, "cmake", &["--build", "build"], folder)?;
    let said = stdout_of(60, "ctest", &["--test-dir", "build", "--verbose"], folder)?;
    ensure!(
        said.contains("100% tests passed") && said.matches("0 values differ").count() == AXES.len(),
        "ctest: {said}"
    );
    println!("check: C: CMake builds three axes, and ctest checks their constants");
    Ok(())
}

/// An application that takes the folder as a Zephyr build takes a module.
fn zephyr(folder: &Path) -> Result<()> {
    let module = fs::read_to_string(folder.join("zephyr/module.yml"))?;
    ensure!(module.contains("cmake: .") && module.contains("kconfig: zephyr/Kconfig"), "module.yml: {module}");
    let kconfig = fs::read_to_string(folder.join("zephyr/Kconfig"))?;
    ensure!(kconfig.contains("config SAGNAC"), "Kconfig: {kconfig}");
    let here = folder.join("zephyr-build");
    fs::create_dir_all(&here)?;
    fs::write(here.join("CMakeLists.txt"), ZEPHYR_STAND_IN)?;
    fs::write(
        here.join("main.c"),
        "#include \"sagnac_unit.h\"\nint main(void) { return SAGNAC_UNIT_AXES == 3U ? 0 : 1; }\n",
    )?;
    stdout_of(120, "cmake", &["-S", ".", "-B", "build"], &here)?;
    stdout_of(300, "cmake", &["--build", "build"], &here)?;
    stdout_of(20, text(&here.join("build/app"))?, &[], &here)?;
    println!("check: C: the Zephyr module builds with Zephyr's three functions replaced");
    Ok(())
}

const ZEPHYR_STAND_IN: &str = "cmake_minimum_required(VERSION 3.20)
project(app C)
set(ZEPHYR_BASE /zephyr)
set(CONFIG_SAGNAC y)
macro(zephyr_library_named name)
  set(ZEPHYR_CURRENT_LIBRARY ${name})
  add_library(${name} STATIC)
  set_property(GLOBAL APPEND PROPERTY ZEPHYR_LIBS ${name})
endmacro()
function(zephyr_library_sources)
  target_sources(${ZEPHYR_CURRENT_LIBRARY} PRIVATE ${ARGN})
endfunction()
function(zephyr_include_directories)
  include_directories(${ARGN})
  set_property(DIRECTORY ${CMAKE_SOURCE_DIR} APPEND PROPERTY INCLUDE_DIRECTORIES ${ARGN})
  target_include_directories(${ZEPHYR_CURRENT_LIBRARY} PRIVATE ${ARGN})
endfunction()
add_subdirectory(.. ${CMAKE_BINARY_DIR}/sagnac)
get_property(libraries GLOBAL PROPERTY ZEPHYR_LIBS)
add_executable(app main.c)
target_link_libraries(app PRIVATE ${libraries})
";

/// The example, as its first comment builds it.
fn example(folder: &Path) -> Result<PathBuf> {
    let sources = fs::read_dir(folder)?.map(|entry| Ok(entry?.file_name().to_string_lossy().into_owned()));
    let mut sources: Vec<String> = sources.collect::<Result<_>>()?;
    sources.retain(|name| name.starts_with("sagnac_") && name.ends_with(".c") && name != "sagnac_unit_check.c");
    sources.sort();
    let program = folder.join("board.elf");
    let flags = [
        "-std=c99",
        "-O2",
        "-Wall",
        "-Wextra",
        "-Wconversion",
        "-Wshadow",
        "-mcpu=cortex-m4",
        "-mthumb",
        "-I.",
        "--specs=nosys.specs",
        "-nostartfiles",
        "-Wl,--section-start=.vectors=0x0",
        "example/board.c",
        "-o",
        text(&program)?,
    ];
    let sources: Vec<&str> = sources.iter().map(String::as_str).collect();
    stdout_of(300, "arm-none-eabi-gcc", &[&flags[..], &sources].concat(), folder)?;
    Ok(program)
}

/// The emulator, ended when this value goes.
struct Emulator(Child);

impl Drop for Emulator {
    fn drop(&mut self) {
        // Both fail only where it has ended.
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

/// Three axes on one line; an upload to the second reaches it alone.
fn on_the_board(program: &Path, newer: &Image) -> Result<()> {
    let machine = ["-M", "mps2-an386", "-nographic", "-monitor", "none", "-serial", "stdio", "-icount", "shift=4"];
    let mut command = Command::new("qemu-system-arm");
    command.args([&machine[..], &["-kernel", text(program)?]].concat());
    let piped = command.stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::null());
    let mut emulator = Emulator(piped.spawn().context("cannot start qemu-system-arm")?);
    let mut line = emulator.0.stdin.take().context("its input")?;
    let mut bytes = BufReader::new(emulator.0.stdout.take().context("its output")?).bytes();
    let mut image = vec![0; newer.encoded_len()];
    newer.encode(&mut image).context("it fits its own length")?;
    let commit = Message::Commit(Commit { len: image.len() as u16, trial: false });
    let mut heard = Heard::default();
    heard.until(&mut bytes, |heard| heard.outputs.iter().all(|outputs| outputs.len() > 5))?;
    for message in Message::pieces(&image).chain([commit]) {
        let frame = message.frame().context("a message without a frame")?.of_axis(newer.description().axis);
        let (bytes, len) = frame.bytes();
        line.write_all(&bytes[..len])?;
    }
    line.flush()?;
    heard.until(&mut bytes, |heard| heard.commits.iter().any(|done| *done))?;
    ensure!(heard.commits == [false, true, false], "the commit was answered by {:?}", heard.commits);
    let before = heard.outputs.each_ref().map(Vec::len);
    heard.until(&mut bytes, |heard| {
        heard.outputs.iter().zip(before).all(|(outputs, before)| outputs.len() > before + FRAMES)
    })?;
    for (axis, outputs) in heard.outputs.iter().enumerate() {
        check_axis(outputs, axis == 1).with_context(|| format!("axis {}", char::from(AXES[axis])))?;
    }
    println!("check: C, Cortex-M4F: the example's three axes on one line; an upload to y reaches y alone");
    Ok(())
}

/// Frames without a gap; the last is corrected with the new image, or none was.
fn check_axis(outputs: &[OutputFrame], has_image: bool) -> Result<()> {
    let last = outputs.last().context("no frame")?;
    let follows = |pair: &[OutputFrame]| pair[1].sequence == pair[0].sequence.wrapping_add(1);
    ensure!(outputs.windows(2).all(follows), "a frame is missing");
    // Ticks that the emulator missed are made up.
    ensure!(last.frame_ticks == sagnac_board::FRAME_TICKS, "{last:?}");
    ensure!(last.tick >= u32::from(last.sequence) * 100 + 100, "{last:?}");
    // A count is 100 clocks of a timer, a tick 2,500: all counts of all ticks, but for the first tick.
    let counts: i64 = outputs.iter().map(|output| i64::from(output.raw)).sum();
    ensure!((25 * i64::from(last.tick) - counts).abs() < 60, "{counts} counts in {} ticks", last.tick);
    ensure!(last.raw > 0 && last.angle_nano_arcsec > 0, "no counts: {last:?}");
    let uncorrected = last.status.contains(Status::UNCORRECTED);
    ensure!(uncorrected != has_image && (last.origin == Origin::Newest) == has_image, "{last:?}");
    ensure!((last.error_milli_dph == UNBOUNDED) != has_image, "{last:?}");
    Ok(())
}

/// What the line said, axis by axis.
#[derive(Default)]
struct Heard {
    reader: FrameReader,
    outputs: [Vec<OutputFrame>; 3],
    commits: [bool; 3],
}

impl Heard {
    fn until(
        &mut self,
        bytes: &mut impl Iterator<Item = std::io::Result<u8>>,
        is_enough: impl Fn(&Self) -> bool,
    ) -> Result<()> {
        for byte in bytes.take(MOST_BYTES) {
            if let Some(frame) = self.reader.push(byte?) {
                self.frame(&frame)?;
                if is_enough(self) {
                    return Ok(());
                }
            }
        }
        ensure!(false, "the board's line ends, or says nothing new");
        Ok(())
    }

    fn frame(&mut self, frame: &Frame) -> Result<()> {
        let axis = usize::from(frame.axis).checked_sub(1).context("a frame without an axis")?;
        match Message::parse(frame) {
            Some(Message::Output(output)) => self.outputs[axis].push(output),
            Some(Message::Reply(reply)) if reply.to == Message::COMMIT => {
                ensure!(reply.code == ReplyCode::Done, "{reply:?}");
                self.commits[axis] = true;
            }
            Some(_) => {}
            None => ensure!(false, "a frame without a meaning: {frame:?}"),
        }
        Ok(())
    }
}
