//! Enums whose variants are words of a case file, each declared once.

/// The error of a text that is not a word of an enum.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("`{given}` is not one of {}", known.join(", "))]
pub struct UnknownWord {
    /// Text that was given as a word.
    pub given: String,
    /// All words that the enum has.
    pub known: Vec<&'static str>,
}

/// Returns a word in the form in which words are compared: lower case, with hyphens for underscores
/// and blanks.
pub fn plain(word: &str) -> String {
    word.trim().to_lowercase().replace(['_', ' '], "-")
}

/// Declares an enum with the name of each variant: `ALL`, `name`, `Display`, `FromStr` and
/// `Serialize`. The first variant is the default.
#[macro_export]
macro_rules! words {
    (
        $(#[$meta:meta])*
        $kind:ident {
            $(#[$first_doc:meta])* $first:ident = $first_name:expr
            $(, $(#[$doc:meta])* $variant:ident = $name:expr)* $(,)?
        }
    ) => {
        $(#[$meta])*
        #[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
        pub enum $kind {
            $(#[$first_doc])*
            #[default]
            $first,
            $($(#[$doc])* $variant),*
        }

        impl $kind {
            /// All variants, in the order of their declaration.
            pub const ALL: [Self; 1 + [$(stringify!($variant)),*].len()] =
                [Self::$first, $(Self::$variant),*];

            /// Returns the name in case files.
            pub const fn name(self) -> &'static str {
                match self {
                    Self::$first => $first_name,
                    $(Self::$variant => $name),*
                }
            }
        }

        impl std::fmt::Display for $kind {
            fn fmt(&self, formatter: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
                formatter.pad(self.name())
            }
        }

        impl std::str::FromStr for $kind {
            type Err = $crate::words::UnknownWord;

            fn from_str(given: &str) -> Result<Self, Self::Err> {
                use $crate::words::plain;
                let word = plain(given);
                let is = |variant: &Self| plain(variant.name()) == word;
                Self::ALL.into_iter().find(is).ok_or_else(|| Self::Err {
                    given: given.to_owned(),
                    known: Self::ALL.map(Self::name).to_vec(),
                })
            }
        }

        impl serde::Serialize for $kind {
            fn serialize<S: serde::Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
                serializer.serialize_str(self.name())
            }
        }
    };
}

pub use words;
