//! Instructions and stack of the correction on the target, image by image, in Rust and in C.

use std::fs;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, ensure};
use sagnac::model::PRICED_WITHIN;
use sagnac_core::{Description, Image, InputSpec, Kind, Multiplier, Shape, Term};
use sagnac_ports::{FixedBias, Part, c_files};
use xtask::shell::{root, stdout_of, text};

use super::build::emulate;
use crate::targets::vector_files::{image, loops, write};

/// Largest numbers of instructions: tick with slew, tick with both loops, slow update.
const MOST: [u32; 3] = [60, 1000, 2000];

/// Instructions and stack, as a program that measures has printed them.
pub(super) struct Measured(String);

impl Measured {
    /// Writes the image where the program looks for it, and runs the one in Rust.
    pub(super) fn of(image: &Image, folder: &Path) -> Result<Self> {
        fs::write(folder.join(MEASURED), sagnac::export::image_bytes(image))?;
        Ok(Self(emulate("measure", &["-serial", "null", "-icount", "shift=0"], folder, 120)?))
    }

    pub(super) fn number(&self, name: &str) -> Result<u32> {
        let line = self.0.lines().find_map(|line| line.strip_prefix(name)?.strip_prefix(' '));
        Ok(line.with_context(|| format!("no {name}: {}", self.0))?.trim().parse()?)
    }
}

/// The image of both programs that measure, in the emulator's working folder.
const MEASURED: &str = "measured.img";

/// Instructions of the image with bias 5, rate 1 and scale 2, which the vectors hold.
pub(super) fn instructions(folder: &Path) -> Result<()> {
    let measured = Measured::of(&image("compensator-full")?, folder)?;
    let [tick, limited] = [measured.number("tick")?, measured.number("tick-limited")?];
    let [slewing, whole, slow] = ["tick-slewing", "tick-whole", "slow-update"].map(|name| measured.number(name));
    let (slewing, whole, slow) = (slewing?, whole?, slow?);
    println!("check: compensation tick {tick} instructions, {slewing} while slewing (at most {})", MOST[0]);
    println!("check: tick at the output limit, slewing: {limited} instructions");
    println!("check: tick with stripping, both loops and frame {whole} instructions on average (at most {})", MOST[1]);
    println!("check: slow update at bias 5, rate 1, scale 2: {slow} instructions (at most {})", MOST[2]);
    println!("       instructions, not cycles: a 100 MHz part has 10,000 cycles per tick");
    for (name, found, most) in
        [("tick", slewing, MOST[0]), ("whole tick", whole, MOST[1]), ("slow update", slow, MOST[2])]
    {
        ensure!(found <= most, "{name}: {found} instructions, at most {most}");
    }
    Ok(())
}

/// Largest numbers of instructions of a slice: Rust and C.
const MOST_SLICE: [u32; 2] = [700, 1600];
/// Largest numbers of instructions of a tick of the whole board, with its part of a slow update; and of the change to another image between
/// two ticks, for which the tick waits: Rust and C.
const MOST_TICK: [u32; 2] = [3000, 3000];
const MOST_SWAP: [u32; 2] = [2000, 2000];

/// Best, typical and worst image: instructions and stack, in Rust and in C.
pub(super) fn prices(folder: &Path) -> Result<()> {
    let full = image("compensator-full")?;
    let images = [("best", with_terms(&full, 1, |_| false)?), ("typical", full), ("worst", worst(&full)?)];
    let c = c_measure(folder)?;
    for (name, image) in images {
        let rust = Measured::of(&image, folder)?;
        let hosting = format!("enable=on,target=native,arg=measure,arg={MEASURED}");
        let machine = ["-M", "mps2-an386", "-cpu", "cortex-m4", "-nographic", "-monitor", "none", "-serial", "null"];
        let rest = ["-icount", "shift=0", "-semihosting-config", &hosting, "-kernel", text(&c)?];
        let c = Measured(stdout_of(120, "qemu-system-arm", &[&machine[..], &rest].concat(), folder)?);
        for (at, (language, said)) in [("Rust", rust), ("C", c)].into_iter().enumerate() {
            let [board, swap, none] = ["tick-largest", "swap", "no-swap"].map(|number| said.number(number));
            let (board, swap) = (board?, swap?.max(none?));
            println!("check: price: {name}, {language}: largest tick of the board {board}, change of the image {swap}");
            for (what, found, most) in [("tick", board, MOST_TICK[at]), ("change of the image", swap, MOST_SWAP[at])] {
                ensure!(found <= most, "{name}, {language}: a {what} of {found} instructions, at most {most}");
            }
            let most = MOST_SLICE[at];
            let [update, slice] = [said.number("slow-update")?, said.number("slice")?];
            println!(
                "check: price: {name}, {language}: slow update {update}, largest slice {slice}, tick {} / {} slewing / {} limited; \
                 stack {} B update, {} B tick",
                said.number("tick")?,
                said.number("tick-slewing")?,
                said.number("tick-limited")?,
                said.number("stack-update")?,
                said.number("stack-tick")?
            );
            ensure!(slice <= most, "{name}, {language}: a slice of {slice} instructions, at most {most}");
        }
    }
    Ok(())
}

/// Four inputs with lags and 32 harmonics of their rates: no legal image takes more instructions.
fn worst(full: &Image) -> Result<Image> {
    let mut description: Description = *full.description();
    description.inputs = [description.inputs[0]; sagnac_core::MAX_INPUTS];
    description.input_count = sagnac_core::MAX_INPUTS as u8;
    for (at, term) in (0_u8..).zip(&mut description.terms) {
        let shape = Shape::Sine { turns_q18: 1 << 18 };
        *term =
            Term { kind: Kind::Bias, input: at % 4, shape, multiplier: Multiplier::Rate, mantissa: 1 << 20, shift: 40 };
    }
    description.term_count = sagnac_core::MAX_TERMS as u8;
    Image::new(description).map_err(|e| anyhow::anyhow!("the worst image: {e}"))
}

/// The C export with `firmware/c/measure.c`, for the emulated Cortex-M4F.
fn c_measure(folder: &Path) -> Result<PathBuf> {
    let (elf, sources) = (folder.join("measure.elf"), folder.join("measured-c"));
    let files = c_files(&[(image("compensator-full")?, FixedBias::Unknown)], Some(&loops()?), &Part::ALL);
    write(&sources, &files)?;
    let own = ["measure.c", "vectors_mps2.c"].map(|name| root().join("firmware/c").join(name));
    let is_module = |name: &&str| name.ends_with(".c") && name.starts_with("sagnac_") && *name != "sagnac_unit_check.c";
    let modules = files.iter().map(|file| file.name.as_str()).filter(is_module).map(|name| sources.join(name));
    let modules: Vec<PathBuf> = modules.chain(own).collect();
    let modules: Vec<&str> = modules.iter().map(|path| text(path)).collect::<Result<_>>()?;
    let part = ["-O2", "-std=c99", "-mcpu=cortex-m4", "-mthumb", "-mfloat-abi=hard", "-mfpu=fpv4-sp-d16"];
    let link = ["--specs=rdimon.specs", "-Wl,--section-start=.vectors=0x0", "-o", text(&elf)?];
    let include = format!("-I{}", text(&sources)?);
    stdout_of(300, "arm-none-eabi-gcc", &[&part[..], &[&include], &modules, &link].concat(), folder)?;
    Ok(elf)
}

/// An image with a part of its terms and the first of its inputs; without a rate term no filter runs.
fn with_terms(of: &Image, inputs: u8, kept: impl Fn(&Term) -> bool) -> Result<Image> {
    let mut description: Description = *of.description();
    let kept: Vec<Term> = of.terms().iter().filter(|term| term.input < inputs && kept(term)).copied().collect();
    description.terms = [Term::ZERO; sagnac_core::MAX_TERMS];
    description.terms[..kept.len()].copy_from_slice(&kept);
    description.term_count = u8::try_from(kept.len())?;
    description.input_count = inputs;
    for (at, input) in (0_u8..).zip(description.inputs.iter_mut()) {
        if kept.iter().all(|term| term.multiplier != Multiplier::Rate || term.input != at) {
            input.lag = InputSpec::UNUSED.lag;
        }
        if at >= inputs {
            *input = InputSpec::UNUSED;
        }
    }
    Image::new(description).map_err(|e| anyhow::anyhow!("an image with fewer terms: {e}"))
}

/// The images whose slow update is counted.
fn priced(full: &Image, inputs: &Image, harmonic: &Image, lags: &Image) -> Result<Vec<(&'static str, Image)>> {
    let order = |term: &Term| term.shape.order().unwrap_or(0);
    let series = |term: &Term| term.kind == Kind::Bias && term.multiplier == Multiplier::One;
    let rate = |term: &Term, most: u8| term.multiplier == Multiplier::Rate && order(term) <= most;
    // The codes of the measurement are valid for every input.
    let with_first_gain = |image: &Image, input: usize| {
        let mut valid = *image.description();
        (valid.inputs[input].gain, valid.inputs[input].offset_q24) = (valid.inputs[0].gain, valid.inputs[0].offset_q24);
        Image::new(valid)
    };
    let (inputs, lags) = (&with_first_gain(inputs, 3)?, &with_first_gain(lags, 2)?);
    Ok(vec![
        ("nothing", with_terms(full, 1, |_| false)?),
        ("bias 1", with_terms(full, 1, |term| series(term) && order(term) <= 1)?),
        ("bias 5", with_terms(full, 1, series)?),
        ("bias 5, rate 0", with_terms(full, 1, |term| series(term) || rate(term, 0))?),
        ("bias 5, rate 1", with_terms(full, 1, |term| series(term) || rate(term, 1))?),
        ("bias 5, rate 1, scale 2", with_terms(full, 1, |_| true)?),
        ("bias 2 and zones", with_terms(inputs, 1, |term| term.multiplier == Multiplier::One)?),
        ("two thermometers", with_terms(inputs, 2, |term| term.multiplier == Multiplier::One)?),
        ("and their difference", with_terms(inputs, 3, |term| term.kind == Kind::Bias)?),
        ("and a voltage with steps", with_terms(inputs, 4, |_| true)?),
        ("bias 3 and harmonics", with_terms(harmonic, 1, |term| term.multiplier == Multiplier::One)?),
        ("harmonics of two thermometers and their rates", with_terms(harmonic, 2, |_| true)?),
        ("two lags", with_terms(lags, 2, |_| true)?),
        ("two lags of two thermometers", with_terms(lags, 4, |_| true)?),
    ])
}

/// Checks the cost formula of `calibrate --tradeoff` against the counted instructions of several images.
pub(super) fn costs(folder: &Path) -> Result<()> {
    let [full, inputs, harmonic, lags] =
        ["full", "inputs", "harmonic", "lags"].map(|name| image(&format!("compensator-{name}")));
    let mut wrong = Vec::new();
    for (name, image) in priced(&full?, &inputs?, &harmonic?, &lags?)? {
        let work = image.work();
        let (counted, priced) = (Measured::of(&image, folder)?.number("slow-update")?, work.instructions());
        println!(
            "check: {name}: slow update of {counted} instructions, {priced} by the formula of docs/explanation/method.md ({work:?})"
        );
        if (f64::from(priced) / f64::from(counted) - 1.0).abs() > PRICED_WITHIN {
            wrong.push(format!("{name}: {priced} instructions by the formula, {counted} counted"));
        }
    }
    ensure!(wrong.is_empty(), "{}", wrong.join("; "));
    Ok(())
}
