//! The verbs of the command line: a file or a folder for each, with its arguments, its work and its words.

mod allan;
#[cfg(feature = "full")]
mod bench;
mod calibrate;
mod compare;
mod compensate;
mod evaluate;
mod export;
mod fleet;
mod import;
mod init;
mod inspect;
mod key;
mod line;
pub(crate) mod manual;
pub(crate) mod old;
mod plan;
mod simulate;
mod verb;
mod verify;

pub(crate) use verb::Verb;

macro_rules! verbs {
    ($($(#[$when:meta])? $name:ident($args:ty),)*) => {
        /// Every verb with its arguments.
        #[derive(clap::Subcommand)]
        pub(crate) enum Verbs {
            $($(#[$when])? $name($args),)*
        }

        impl Verbs {
            pub(crate) fn verb(&mut self) -> &mut dyn Verb {
                match self {
                    $($(#[$when])? Self::$name(args) => args,)*
                }
            }
        }
    };
}

// In the order of the help.
verbs! {
    Calibrate(calibrate::Args),
    Verify(verify::Args),
    Compare(compare::Args),
    Compensate(compensate::Args),
    Allan(allan::Args),
    Inspect(inspect::Args),
    Evaluate(evaluate::Args),
    Fleet(fleet::Args),
    Plan(plan::Args),
    #[cfg(feature = "full")]
    Bench(bench::Args),
    Export(export::Args),
    Key(key::Args),
    Line(line::Args),
    Import(import::Args),
    Init(init::Args),
    Simulate(simulate::Args),
}
