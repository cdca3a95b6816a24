//! Status words of the loops: a byte of named bits each. Zero: nothing to report.

/// Declares a status: its bits in order, from the lowest.
macro_rules! status {
    ($(#[doc = $about:literal])+ $name:ident { $( $(#[doc = $text:literal])+ $bit:ident = $value:expr; )+ }) => {
        $(#[doc = $about])+
        #[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
        pub struct $name(u8);

        impl $name {
            /// Nothing to report.
            pub const OK: Self = Self(0);
            $( $(#[doc = $text])+ pub const $bit: Self = Self(1 << $value); )+

            /// Every single bit with its name.
            pub const NAMES: &'static [(Self, &'static str)] = &[$( (Self::$bit, stringify!($bit)) ),+];

            /// The raw bits.
            pub const fn bits(self) -> u8 {
                self.0
            }

            /// True when every bit of `other` is set here.
            pub const fn contains(self, other: Self) -> bool {
                self.0 & other.0 == other.0
            }
        }

        impl core::ops::BitOr for $name {
            type Output = Self;
            fn bitor(self, other: Self) -> Self {
                Self(self.0 | other.0)
            }
        }

        impl core::ops::BitOrAssign for $name {
            fn bitor_assign(&mut self, other: Self) {
                *self = *self | other;
            }
        }
    };
}
pub(crate) use status;
