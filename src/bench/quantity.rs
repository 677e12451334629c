//! What was measured where faster is better, for people and for machines: the ratio says how many
//! times faster ours is than what it is held against.

use serde_json::{Value as Json, json};
use std::fmt::Write as _;

/// One measured quantity.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Quantity {
    pub(super) name: String,
    pub(super) value: f64,
    pub(super) unit: &'static str,
    /// The same by another engine, and whether that is a lower bound, because it was ended.
    pub(super) peer: Option<(f64, bool)>,
    /// What the other is, where the name does not say it.
    pub(super) beside: String,
}

impl Quantity {
    pub(super) fn new(name: String, value: f64, unit: &'static str) -> Self {
        Self {
            name,
            value,
            unit,
            peer: None,
            beside: String::new(),
        }
    }

    /// How many times faster than the peer.
    fn ratio(&self) -> Option<f64> {
        self.peer.map(|(peer, _)| peer / self.value)
    }

    pub(crate) fn to_json(&self) -> Json {
        let mut row = json!({
            "name": self.name,
            "value": self.value,
            "unit": self.unit,
            "peer": self.peer.map(|(peer, _)| peer),
            "ratio": self.ratio(),
        });
        if !self.beside.is_empty() {
            row["beside"] = json!(self.beside);
        }
        row
    }
}

/// The quantities for people.
pub(crate) fn table(quantities: &[Quantity]) -> String {
    let number = |number: f64| match number.abs() {
        size if size >= 1000.0 => format!("{number:.0}"),
        size if size >= 10.0 => format!("{number:.1}"),
        _ => format!("{number:.3}"),
    };
    let mut text = super::figure::host();
    // Writing to a string does not fail.
    let _ = writeln!(
        text,
        "\n{:<32}{:>12} {:<13}{:>14}{:>12}",
        "", "ours", "", "peer's", "faster"
    );
    for quantity in quantities {
        let bound = quantity
            .peer
            .filter(|(_, bound)| *bound)
            .map_or("", |_| ">");
        let [peer, ratio] = [quantity.peer.map(|(peer, _)| peer), quantity.ratio()].map(|value| {
            value.map_or_else(String::new, |value| format!("{bound}{}", number(value)))
        });
        let Quantity {
            name,
            value,
            unit,
            beside,
            ..
        } = quantity;
        let value = number(*value);
        let row = format!("{name:<32}{value:>12} {unit:<13}{peer:>14}{ratio:>12}  {beside}");
        let _ = writeln!(text, "{}", row.trim_end());
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_peer_that_was_ended_is_told_as_a_lower_bound() {
        let mut quantity = Quantity::new("all_deliver_100k_vf2".to_owned(), 20.0, "us");
        assert_eq!(quantity.to_json()["ratio"], Json::Null);
        quantity.peer = Some((60_000.0, true));
        assert_eq!(quantity.to_json()["ratio"], 3000.0);
        assert!(table(&[quantity]).contains(">3000"));
    }

    #[test]
    fn what_ours_is_held_against_is_told_where_the_name_does_not() {
        let mut quantity = Quantity::new("density_100".to_owned(), 0.5, "ms");
        assert_eq!(quantity.to_json()["beside"], Json::Null);
        quantity.peer = Some((10.0, false));
        "windowed numpy".clone_into(&mut quantity.beside);
        assert_eq!(quantity.to_json()["beside"], "windowed numpy");
        assert!(table(&[quantity]).contains("20.0  windowed numpy"));
    }
}
