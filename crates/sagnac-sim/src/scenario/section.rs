//! One declaration per key: type, default, range, unit, source and description.
//!
//! The macro [`section!`] makes three things of a declaration: the struct that reads the table, the range check, and
//! the entry of the manual (`docs/reference/scenario.md`). They cannot drift apart.

/// Manual entry of a key; scenarios are checked against the same range.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct KeyDoc {
    /// Name in its table.
    pub name: &'static str,
    /// Description.
    pub text: &'static str,
    /// Unit; empty for a pure number.
    pub unit: &'static str,
    /// Smallest and largest value; `None` for a word.
    pub range: Option<(f64, f64)>,
    /// Default; `None` if the key is required.
    pub default: Option<f64>,
    /// Allowed words, if the value is a word.
    pub words: &'static str,
    /// Where the range comes from.
    pub source: &'static str,
}

/// A table of the file.
pub(crate) trait Section {
    /// Its name.
    const PATH: &'static str;
    /// Its description.
    const ABOUT: &'static str;
    /// Its keys.
    const KEYS: &'static [KeyDoc];
    /// Values of the numeric keys, in the order of `KEYS`.
    fn numbers(&self) -> Vec<f64>;
}

/// Default of a required key.
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
            const KEYS: &'static [$crate::scenario::section::KeyDoc] = &[
                $( $crate::scenario::section::KeyDoc {
                    name: stringify!($word), text: concat!($($word_text),+), unit: "", range: None,
                    default: None, words: $words, source: "",
                }, )*
                $( $crate::scenario::section::KeyDoc {
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
