//! Paper TG's Figs 13 and 14: the shapes that personal space takes under socialization features. The
//! figures print no lengths, so what is held against them is all that the text says of each shape: its form, which
//! sides grow or shrink and in which order, and by how much.

use super::drawn::{Drawn, draw};
use super::table::{Cell, Row, Table};
use crate::Failure;
use agents::social_mapping::features::{Feature, Features, Influence, InfluenceLaw};
use agents::social_mapping::{AsymmetricGaussian, FourSided, SocialConfig};
use nalgebra::{Isometry2, Vector2};
use std::collections::BTreeMap;
use std::f64::consts::FRAC_PI_2;

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

/// What is claimed of a shape: what ours is, and what the paper says.
type Claim = (String, &'static str);

/// A row of a shape; which of the laws the claim is about is the caller's.
fn row(
    label: &str,
    influences: &[[f64; 4]],
    values: &[f64],
    claim: impl Into<Option<Claim>>,
    note: Option<&'static str>,
) -> Row {
    let [closer, printed] = [InfluenceLaw::PositiveIsCloser, InfluenceLaw::Printed]
        .map(|law| shape(law, influences, values));
    let listed: Vec<String> = influences
        .iter()
        .map(|sides| sides.map(|side| format!("{side:.1}")).join(" "))
        .collect();
    let values: Vec<String> = values.iter().map(|value| format!("{value:.2}")).collect();
    let claim = claim
        .into()
        .map_or_else(Cell::nothing, |(ours, says)| Cell::texts(ours, says));
    Row {
        label: label.to_owned(),
        cells: vec![
            Cell::text(values.join(", ")),
            Cell::text(listed.join(", ")),
            widths(closer),
            widths(printed),
            claim,
        ],
        note,
    }
}

/// A row of one claim about several shapes.
fn summary(label: &str, claim: Cell) -> Row {
    let mut cells = vec![Cell::nothing(); 4];
    cells.push(claim);
    Row {
        label: label.to_owned(),
        cells,
        note: None,
    }
}

/// `says` where it `holds`.
fn claim(holds: bool, says: &'static str) -> Claim {
    let ours = if holds { says } else { "not so" };
    (ours.to_owned(), says)
}

/// The shapes of Fig. 13: influences, and what the text calls each.
const FORMS: [(&str, [f64; 4], Form); 5] = [
    ("13a", [0.5; 4], Form::Circle),
    ("13b", [0.5, 0.2, 0.1, 0.2], Form::Egg),
    ("13c", [-0.5, 0.5, -0.5, 0.5], Form::AlongEllipse),
    ("13d", [0.5, -0.5, 0.5, -0.5], Form::AcrossEllipse),
    ("13e", [0.5, 0.4, 0.1, 0.1], Form::Dominant),
];
/// The moods of Fig. 14a, from the most upset on, and the influence of mood.
const MOODS: [(&str, f64); 7] = [
    ("angry", 0.14),
    ("disgusted", 0.28),
    ("fearful", 0.42),
    ("sad", 0.56),
    ("neutral", 0.70),
    ("surprised", 0.84),
    ("happy", 0.98),
];
const MOOD: [f64; 4] = [0.9, 0.5, 0.0, 0.5];
/// The needs of Fig. 14b, of food and drink, and from where the waiter may come the nearer; their influences.
const NEEDS: [(&str, [f64; 2], &str); 4] = [
    ("needs both", [0.9, 0.9], "both sides alike"),
    ("food neutral, no drink", [0.5, 0.1], "left the nearer"),
    ("needs food, drink neutral", [0.9, 0.5], "left the nearer"),
    ("no food, needs drink", [0.1, 0.9], "right the nearer"),
];
const SERVICE: [[f64; 4]; 2] = [[0.0, 0.5, 0.0, 0.0], [0.0, 0.0, 0.0, 0.5]];

fn same(a: f64, b: f64) -> bool {
    (a - b).abs() < 1e-9
}

fn forms() -> Vec<Row> {
    const SIGNS: &str = "READING.md 4: print lost the minus signs of two influences; with all four .5 this \
        is Fig. 13a. A negative influence keeps the printed width";
    const GROWS: &str = "READING.md 4: the drawings widen a side with its influence, as the printed law does; by \
        positive_is_closer the same side is the narrowest";
    let mut rows: Vec<Row> = FORMS
        .iter()
        .map(|(label, influence, form)| {
            // Of an ellipse, both laws have the form that the text names.
            let ours = Form::of(shape(InfluenceLaw::Printed, &[*influence], &[0.5]));
            let note = match form {
                Form::AlongEllipse | Form::AcrossEllipse => Some(SIGNS),
                Form::Egg | Form::Dominant => Some(GROWS),
                Form::Circle => None,
            };
            let claim = (ours.name().to_owned(), form.name());
            row(label, &[*influence], &[0.5], claim, note)
        })
        .collect();
    let printed = |influence, value| shape(InfluenceLaw::Printed, &[influence], &[value]);
    let any = [0.1, 0.3, 0.7, 0.9];
    let round = any
        .iter()
        .all(|value| Form::of(printed(FORMS[0].1, *value)) == Form::Circle);
    let egg = printed(FORMS[1].1, 0.5);
    let tall = egg.front > egg.left && egg.left > egg.rear;
    let left = printed(FORMS[4].1, 0.5);
    let dominant = left.left > left.right && left.front > left.rear;
    let claims = [
        (
            "13a, any value",
            claim(round, "a circle with any value of the feature"),
        ),
        (
            "13b",
            claim(tall, "front, left and right count for more than the rear"),
        ),
        (
            "13e",
            claim(dominant, "one side counts for more than the other"),
        ),
    ];
    rows.extend(claims.map(|(label, (ours, says))| summary(label, Cell::texts(ours, says))));
    rows
}

fn moods() -> Vec<Row> {
    const RANKS: [&str; 7] = [
        "1st of 7 ahead, the most upset",
        "2nd of 7 ahead",
        "3rd of 7 ahead",
        "4th of 7 ahead",
        "5th of 7 ahead",
        "6th of 7 ahead",
        "7th of 7 ahead, the happiest",
    ];
    let of = |value: f64| shape(InfluenceLaw::PositiveIsCloser, &[MOOD], &[value]);
    let larger = |value: f64| {
        MOODS
            .iter()
            .filter(move |(_, other)| of(*other).front > of(value).front)
    };
    let mut rows: Vec<Row> = MOODS
        .iter()
        .zip(RANKS)
        .map(|((mood, value), says)| {
            let ours = RANKS[larger(*value).count()].to_owned();
            row(
                &format!("14a {mood}"),
                &[MOOD],
                &[*value],
                (ours, says),
                None,
            )
        })
        .collect();
    let slopes = MOODS.windows(2).map(|pair| {
        let [(_, low), (_, high)] = [pair[0], pair[1]];
        (of(high).front.powi(2) - of(low).front.powi(2)) / (high - low)
    });
    let proportional = slopes.collect::<Vec<f64>>();
    let even = proportional
        .iter()
        .all(|slope| *slope < 0.0 && same(*slope, proportional[0]));
    let (ours, says) = claim(even, "ahead it grows and shrinks in proportion to the mood");
    rows.push(summary("14a ahead", Cell::texts(ours, says)));
    let behind = MOODS.iter().all(|(_, value)| same(of(*value).rear, BASE));
    let (ours, says) = claim(behind, "behind, where the influence is 0, nothing changes");
    rows.push(summary("14a behind", Cell::texts(ours, says)));
    rows
}

fn needs() -> Vec<Row> {
    let of = |values: &[f64]| shape(InfluenceLaw::PositiveIsCloser, &SERVICE, values);
    let mut rows: Vec<Row> = NEEDS
        .iter()
        .map(|(label, values, says)| {
            let shape = of(values);
            let ours = match () {
                () if same(shape.left, shape.right) => "both sides alike",
                () if shape.left < shape.right => "left the nearer",
                () => "right the nearer",
            };
            let claim = (ours.to_owned(), *says);
            row(&format!("14b {label}"), &SERVICE, values, claim, None)
        })
        .collect();
    let untouched = NEEDS.iter().all(|(_, values, _)| {
        let shape = of(values);
        same(shape.front, BASE) && same(shape.rear, BASE)
    });
    let (ours, says) = claim(untouched, "food and drink act to the left and right alone");
    rows.push(summary("14b ahead and behind", Cell::texts(ours, says)));
    let weighed = NEEDS.iter().all(|(_, values, _)| {
        let both = of(values);
        let [left, right] = [both.left, both.right].map(|side| 1.0 - side * side);
        same(left, SERVICE[0][1] * values[0]) && same(right, SERVICE[1][3] * values[1])
    });
    let (ours, says) = claim(
        weighed,
        "features combine in a linear way, their influences being the weights",
    );
    rows.push(summary("14b both features", Cell::texts(ours, says)));
    rows
}

#[allow(
    clippy::unnecessary_wraps,
    reason = "one kind of function for all experiments"
)]
pub(super) fn shapes() -> Result<Table, Failure> {
    Ok(Table {
        columns: vec![
            "values",
            "influence f l b r",
            "widths, positive_is_closer",
            "widths, printed",
            "the paper says",
        ],
        rows: [forms(), moods(), needs()].into_iter().flatten().collect(),
        notes: vec![
            "Widths ahead, left, behind, right in units of the width without features. The figures print no lengths: what \
             their text says is compared,\nof Fig. 13 under `printed`, of Fig. 14 under `positive_is_closer`; \
             `--pictures DIR` draws them as ours are.",
            "14b: the text's rule is food from the left and drink from the right; which side is the nearer in each of its four \
             cases follows from that.",
            "READING.md 4: `printed` multiplies variances by the influence, so a happier person's space grows \
             ahead, against the text; `positive_is_closer` shrinks it, as the text and Fig. 14a have it.\n\
             A width whose printed influence is 0 or less stays as it is.",
        ],
    })
}

/// Figs 13, 14a and 14b as ours are: people side by side, each with the features of one shape.
pub(super) fn pictures() -> Result<Vec<Drawn>, Failure> {
    let form = |(name, influence, _): &(&str, [f64; 4], Form)| Shown {
        name: (*name).to_owned(),
        influences: vec![*influence],
        values: vec![0.5],
    };
    let mood = |(name, value): &(&str, f64)| Shown {
        name: (*name).to_owned(),
        influences: vec![MOOD],
        values: vec![*value],
    };
    let need = |(name, values, _): &(&str, [f64; 2], &str)| Shown {
        name: (*name).to_owned(),
        influences: SERVICE.to_vec(),
        values: values.to_vec(),
    };
    let forms: Vec<Shown> = FORMS.iter().map(form).collect();
    let moods: Vec<Shown> = MOODS.iter().map(mood).collect();
    let needs: Vec<Shown> = NEEDS.iter().map(need).collect();
    Ok(vec![
        side_by_side("tg-fig13", InfluenceLaw::Printed, &forms)?,
        side_by_side("tg-fig14a", InfluenceLaw::PositiveIsCloser, &moods)?,
        side_by_side("tg-fig14b", InfluenceLaw::PositiveIsCloser, &needs)?,
    ])
}

/// Somebody to draw.
struct Shown {
    name: String,
    influences: Vec<[f64; 4]>,
    values: Vec<f64>,
}

fn side_by_side(name: &'static str, law: InfluenceLaw, shown: &[Shown]) -> Result<Drawn, Failure> {
    // From one to the next, metres: their zones do not meet.
    const APART: f64 = 6.0;
    let (mut people, mut known) = (Vec::new(), BTreeMap::new());
    for (at, one) in shown.iter().enumerate() {
        let mut values = BTreeMap::new();
        for ((index, feature), value) in features(law, &one.influences)
            .known
            .into_iter()
            .zip(&one.values)
        {
            let feature_name = format!("{} {index}", one.name);
            values.insert(feature_name.clone(), *value);
            known.insert(feature_name, feature);
        }
        // Facing up the page.
        let pose = Isometry2::new(Vector2::new(at as f64 * APART, 0.0), FRAC_PI_2);
        people.push((one.name.clone(), pose, values));
    }
    let mut config = SocialConfig {
        features: Features { law, known },
        ..SocialConfig::default()
    };
    config.proxemics.shape = AsymmetricGaussian {
        front: BASE,
        side: BASE,
        rear: BASE,
    };
    draw(name, &people, &config)
}
