//! Paper TG's Figs 13 and 14: the shapes that personal space takes under socialization features. The
//! figures print no lengths, so what is held against them is what the text says of each shape.

use super::table::{Cell, Row, Table};
use crate::Failure;
use agents::social_mapping::FourSided;
use agents::social_mapping::features::{Feature, Features, Influence, InfluenceLaw};
use std::collections::BTreeMap;

/// What the paper says a shape is.
#[derive(Clone, Copy, PartialEq)]
enum Form {
    Circle,
    Egg,
    AlongEllipse,
    AcrossEllipse,
    Dominant,
}

impl Form {
    fn name(self) -> &'static str {
        match self {
            Self::Circle => "circle",
            Self::Egg => "egg",
            Self::AlongEllipse => "ellipse along the heading",
            Self::AcrossEllipse => "ellipse across the heading",
            Self::Dominant => "one side dominant",
        }
    }

    /// What a shape is, by its widths.
    fn of(shape: FourSided) -> Self {
        let same = |a: f64, b: f64| (a - b).abs() < 1e-9;
        let FourSided {
            front,
            left,
            rear,
            right,
        } = shape;
        if same(left, right) && same(front, rear) {
            match () {
                () if same(front, left) => Self::Circle,
                () if front > left => Self::AlongEllipse,
                () => Self::AcrossEllipse,
            }
        } else if same(left, right) {
            Self::Egg
        } else {
            Self::Dominant
        }
    }
}

/// TG starts from the same width to all sides; 1 m, so that widths are shares of it.
const BASE: f64 = 1.0;

fn features(law: InfluenceLaw, influences: &[[f64; 4]]) -> Features {
    let known = influences.iter().enumerate().map(|(index, sides)| {
        let [front, left, rear, right] = *sides;
        let influence = Influence {
            front,
            left,
            rear,
            right,
        };
        let feature = Feature {
            influence,
            ..Feature::default()
        };
        (index.to_string(), feature)
    });
    Features {
        law,
        known: known.collect(),
    }
}

fn shape(law: InfluenceLaw, influences: &[[f64; 4]], values: &[f64]) -> FourSided {
    let values: BTreeMap<String, f64> = values
        .iter()
        .enumerate()
        .map(|(index, value)| (index.to_string(), *value))
        .collect();
    features(law, influences).apply(FourSided::round(BASE), &values)
}

fn widths(shape: FourSided) -> Cell {
    let sides = shape.sides().map(|side| format!("{side:.2}"));
    Cell::text(sides.join(" "))
}

fn row(
    label: &str,
    influences: &[[f64; 4]],
    values: &[f64],
    form: Option<(Form, bool)>,
    note: Option<&'static str>,
) -> Row {
    let printed = shape(InfluenceLaw::Printed, influences, values);
    let closer = shape(InfluenceLaw::PositiveIsCloser, influences, values);
    let listed: Vec<String> = influences
        .iter()
        .map(|sides| sides.map(|side| format!("{side:.1}")).join(" "))
        .collect();
    let values: Vec<String> = values.iter().map(|value| format!("{value:.2}")).collect();
    let form = match form {
        // The drawings widen a side with its influence, as the printed law does.
        Some((form, true)) => Cell::texts(Form::of(printed).name(), form.name()),
        Some((form, false)) => Cell::texts(Form::of(closer).name(), form.name()),
        None => Cell::text("-"),
    };
    Row {
        label: label.to_owned(),
        cells: vec![
            Cell::text(values.join(", ")),
            Cell::text(listed.join(", ")),
            widths(closer),
            widths(printed),
            form,
        ],
        note,
    }
}

#[allow(
    clippy::unnecessary_wraps,
    reason = "one kind of function for all experiments"
)]
pub(super) fn shapes() -> Result<Table, Failure> {
    const SIGNS: &str = "READING.md 4: print lost the minus signs of two influences; with all four .5 this \
        is Fig. 13a. A negative influence keeps the printed width";
    let mut rows = vec![
        row("13a", &[[0.5; 4]], &[0.5], Some((Form::Circle, true)), None),
        row(
            "13b",
            &[[0.5, 0.2, 0.1, 0.2]],
            &[0.5],
            Some((Form::Egg, true)),
            None,
        ),
        row(
            "13c",
            &[[-0.5, 0.5, -0.5, 0.5]],
            &[0.5],
            Some((Form::AlongEllipse, false)),
            Some(SIGNS),
        ),
        row(
            "13d",
            &[[0.5, -0.5, 0.5, -0.5]],
            &[0.5],
            Some((Form::AcrossEllipse, false)),
            Some(SIGNS),
        ),
        row(
            "13e",
            &[[0.5, 0.4, 0.1, 0.1]],
            &[0.5],
            Some((Form::Dominant, true)),
            None,
        ),
    ];
    let emotions = [
        ("14a angry", 0.14),
        ("14a disgusted", 0.28),
        ("14a fearful", 0.42),
        ("14a sad", 0.56),
        ("14a neutral", 0.70),
        ("14a surprised", 0.84),
        ("14a happy", 0.98),
    ];
    for (label, value) in emotions {
        rows.push(row(label, &[[0.9, 0.5, 0.0, 0.5]], &[value], None, None));
    }
    let needs = [
        ("14b needs both", [0.9, 0.9]),
        ("14b food neutral, no drink", [0.5, 0.1]),
        ("14b needs food, drink neutral", [0.9, 0.5]),
        ("14b no food, needs drink", [0.1, 0.9]),
    ];
    let service = [[0.0, 0.5, 0.0, 0.0], [0.0, 0.0, 0.0, 0.5]];
    for (label, values) in needs {
        rows.push(row(label, &service, &values, None, None));
    }
    Ok(Table {
        columns: vec![
            "values",
            "influence f l b r",
            "widths, positive_is_closer",
            "widths, printed",
            "form",
        ],
        rows,
        notes: vec![
            "Widths ahead, left, behind, right in units of the width without features.",
            "READING.md 4: `printed` multiplies variances by the influence, so a happier person's space grows \
             ahead, against the text; `positive_is_closer` shrinks it, as the text and Fig. 14a have it.\n\
             A width whose printed influence is 0 or less stays as it is.",
        ],
    })
}
