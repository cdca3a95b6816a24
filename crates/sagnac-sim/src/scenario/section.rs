//! One declaration per key: type, default, range, unit, source and words, so that none can drift from the others.

/// What is said of a key in the manual and checked when a scenario is read.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Key {
    /// Name in its table.
    pub name: &'static str,
    /// What it is.
    pub text: &'static str,
    /// Unit, empty for a pure number.
    pub unit: &'static str,
    /// Smallest and largest value; `None` for a word.
    pub range: Option<(f64, f64)>,
    /// Value where none is given; `None` where one must be.
    pub default: Option<f64>,
    /// Words that can be given, for a word.
    pub words: &'static str,
    /// Where the range comes from.
    pub source: &'static str,
}

/// A table of the file.
pub(crate) trait Section {
    /// Its name.
    const PATH: &'static str;
    /// What it is.
    const ABOUT: &'static str;
    /// Its keys.
    const KEYS: &'static [Key];
    /// Values of the numeric keys, in their order.
    fn numbers(&self) -> Vec<f64>;
}

/// A value that must be given.
pub(crate) const REQUIRED: f64 = f64::NAN;

/// Declares a table: `numbers { key = default, range, unit, source; }` and `words { key: Type = default, words; }`.
macro_rules! section {
    (
        $(#[doc = $about:literal])+
        $name:ident $path:literal
        numbers { $( $(#[doc = $text:literal])+ $key:ident = $default:expr, $lo:literal ..= $hi:literal, $unit:literal, $source:literal; )* }
        words { $( $(#[doc = $word_text:literal])+ $word:ident: $type:ty = $word_default:expr, $words:literal; )* }
    ) => {
        $(#[doc = $about])+
        #[derive(Clone, Debug, PartialEq, serde::Deserialize)]
        #[serde(default, deny_unknown_fields)]
        pub struct $name {
            $( $(#[doc = $text])+ pub $key: f64, )*
            $( $(#[doc = $word_text])+ pub $word: $type, )*
        }

        impl Default for $name {
            fn default() -> Self {
                Self { $( $key: $default, )* $( $word: $word_default, )* }
            }
        }

        impl $crate::scenario::section::Section for $name {
            const PATH: &'static str = $path;
            const ABOUT: &'static str = concat!($($about),+);
            const KEYS: &'static [$crate::scenario::section::Key] = &[
                $( $crate::scenario::section::Key {
                    name: stringify!($word), text: concat!($($word_text),+), unit: "", range: None,
                    default: None, words: $words, source: "",
                }, )*
                $( $crate::scenario::section::Key {
                    name: stringify!($key), text: concat!($($text),+), unit: $unit, range: Some(($lo, $hi)),
                    default: { let value: f64 = $default; if value.is_nan() { None } else { Some(value) } },
                    words: "", source: $source,
                }, )*
            ];
            fn numbers(&self) -> Vec<f64> {
                vec![$( self.$key ),*]
            }
        }
    };
}
pub(crate) use section;
