//! Figures that go by a name in configuration and on the command line: the papers' and the authors' own. This file
//! owns how such figures are written: a name where a table could stand. It guarantees that a name which is none is
//! told with those there are.

use serde::Deserializer;
use serde::de::{Error, MapAccess, Visitor};
use std::fmt::{self, Formatter, Write as _};
use std::marker::PhantomData;

/// A name, and what makes the figures of that name.
pub type Named<T> = (&'static str, fn() -> T);

/// Figures of which some have names.
pub trait Preset: Sized + 'static {
    /// What they are, in the plural.
    const WHAT: &'static str;
    /// Those with names, the default first.
    const PRESETS: &'static [Named<Self>];

    /// Those of that name.
    fn find_preset(name: &str) -> Option<Self> {
        let found = Self::PRESETS.iter().find(|(known, _)| *known == name);
        found.map(|(_, make)| make())
    }
}

/// The figures of a table, written out.
pub(super) trait Table: Preset {
    /// Reads it.
    fn read<'de, D: Deserializer<'de>>(table: D) -> Result<Self, D::Error>;
}

/// Reads figures by name, or one by one.
pub(super) fn read<'de, T: Table, D: Deserializer<'de>>(from: D) -> Result<T, D::Error> {
    from.deserialize_any(NameOrTable(PhantomData))
}

struct NameOrTable<T>(PhantomData<T>);

impl<'de, T: Table> Visitor<'de> for NameOrTable<T> {
    type Value = T;

    fn expecting(&self, to: &mut Formatter<'_>) -> fmt::Result {
        write!(to, "{} as a table, or one of {}", T::WHAT, names::<T>())
    }

    fn visit_str<E: Error>(self, name: &str) -> Result<T, E> {
        T::find_preset(name).ok_or_else(|| {
            let (what, known) = (T::WHAT, names::<T>());
            E::custom(format!("there are no {what} `{name}`; there are {known}"))
        })
    }

    fn visit_map<A: MapAccess<'de>>(self, map: A) -> Result<T, A::Error> {
        T::read(serde::de::value::MapAccessDeserializer::new(map))
    }
}

/// The names of presets, for people.
fn names<T: Preset>() -> String {
    let mut text = String::new();
    for (at, (name, _)) in T::PRESETS.iter().enumerate() {
        let between = match at {
            0 => "",
            _ if at + 1 == T::PRESETS.len() => " and ",
            _ => ", ",
        };
        // Writing to a string does not fail.
        let _ = write!(text, "{between}`{name}`");
    }
    text
}

/// Implements reading for figures whose fields are those of a table.
macro_rules! named_or_table {
    ($figures:ty, $table:ty) => {
        impl crate::social_mapping::preset::Table for $figures {
            fn read<'de, D: serde::Deserializer<'de>>(table: D) -> Result<Self, D::Error> {
                <$table>::deserialize(table)
            }
        }

        impl<'de> serde::Deserialize<'de> for $figures {
            fn deserialize<D: serde::Deserializer<'de>>(from: D) -> Result<Self, D::Error> {
                crate::social_mapping::preset::read(from)
            }
        }
    };
}
pub(super) use named_or_table;

#[cfg(test)]
mod tests {
    use super::super::{AsymmetricGaussian, Levels, Proxemics, SocialConfig, UsageCurve};
    use super::*;
    use serde::Deserialize;

    fn read<T: for<'de> Deserialize<'de>>(json: &str) -> Result<T, String> {
        serde_json::from_str(json).map_err(|error| error.to_string())
    }

    #[test]
    fn every_preset_is_read_by_its_name_and_makes_sense() {
        fn each<T: Preset + for<'de> Deserialize<'de> + PartialEq + fmt::Debug + Default>(
            valid: fn(&T) -> bool,
        ) {
            assert_eq!(T::PRESETS[0].1(), T::default());
            for (name, make) in T::PRESETS {
                let read: T = read(&format!("\"{name}\"")).unwrap();
                assert_eq!(read, make(), "{name}");
                assert!(valid(&read), "{name}");
            }
        }
        each::<AsymmetricGaussian>(AsymmetricGaussian::is_valid);
        each::<Levels>(Levels::is_valid);
        each::<Proxemics>(|one| one.shape.is_valid() && one.levels.is_valid());
        each::<UsageCurve>(UsageCurve::is_valid);
    }

    #[test]
    fn a_table_may_name_some_figures_and_give_others() {
        let config: SocialConfig = read(
            r#"{"proxemics": {"levels": "authors_8_5_2"}, "usage": "steps",
                "usage_of": {"tv": {"ramp": 60, "steps": {"rise": 1, "every": 30}}}}"#,
        )
        .unwrap();
        assert_eq!(config.proxemics.shape, AsymmetricGaussian::HALL);
        assert!((config.proxemics.levels.personal - 0.5).abs() < 1e-12);
        assert!((config.proxemics.levels.intimate - 0.8).abs() < 1e-12);
        assert_eq!(config.usage, UsageCurve::stepped());
        assert!((config.usage_of["tv"].least - 1.5).abs() < 1e-12);
        let config: SocialConfig = read(r#"{"proxemics": "adaptive_proxemics"}"#).unwrap();
        assert_eq!(config, SocialConfig::adaptive_proxemics());
        let text = serde_json::to_string(&config).unwrap();
        assert_eq!(read::<SocialConfig>(&text).unwrap(), config);
    }

    #[test]
    fn what_has_no_name_is_told_with_what_has() {
        let error = read::<Levels>("\"authors\"").unwrap_err();
        assert!(
            error.starts_with(
                "there are no levels `authors`; there are `hall`, `authors_9_6_3`, `authors_8_5_2` and \
                 `adaptive_proxemics`"
            ),
            "{error}"
        );
        let error = read::<UsageCurve>("7").unwrap_err();
        assert!(
            error.contains("curves as a table, or one of `linear` and `steps`"),
            "{error}"
        );
        let error = read::<Proxemics>(r#"{"shapes": "hall"}"#).unwrap_err();
        assert!(error.starts_with("unknown field `shapes`"), "{error}");
    }
}
