//! Paper TG's Figs 11, 12 and 15: groups by triangulation, and the space of a group. The figures
//! print neither places nor widths; the arrangements here are ours, made to be what the text
//! says each figure shows, and what the text says comes of them is compared.

use super::drawn::{Drawn, draw};
use super::table::{Cell, Row, Table};
use crate::Failure;
use agents::social_mapping::features::{Feature, Features, Influence};
use agents::social_mapping::groups::{GroupEntity, Grouping, Method, Triangulation};
use agents::social_mapping::{FourSided, SocialConfig};
use nalgebra::{Isometry2, Point2, Vector2};
use std::collections::BTreeMap;
use std::f64::consts::{FRAC_PI_2, PI, TAU};

type People = Vec<Isometry2<f64>>;
type Groups = Vec<Vec<usize>>;

fn at(x: f64, y: f64, heading: f64) -> Isometry2<f64> {
    Isometry2::new(Vector2::new(x, y), heading)
}

fn rules(longest_side: f64, vector: f64) -> Grouping {
    Grouping {
        triangulation_strict: Triangulation {
            longest_side,
            vector,
        },
        ..Grouping::of(Method::TriangulationStrict)
    }
}

fn strict(people: &[Isometry2<f64>], longest_side: f64, vector: f64) -> Result<Groups, Failure> {
    let groups = rules(longest_side, vector).groups(people);
    groups.map_err(Failure::internal)
}

/// Groups with their members counted from 1, as in the figures.
fn shown(groups: &Groups) -> String {
    let one = |group: &Vec<usize>| {
        let names: Vec<String> = group.iter().map(|i| (i + 1).to_string()).collect();
        format!("{{{}}}", names.join(" "))
    };
    groups.iter().map(one).collect::<Vec<_>>().join(" ")
}

/// Ten people in the unit square, in two bunches of which one is looser.
fn ten() -> People {
    [
        (0.10, 0.10),
        (0.30, 0.12),
        (0.18, 0.32),
        (0.38, 0.35),
        (0.05, 0.40),
        (0.62, 0.95),
        (0.95, 0.90),
        (0.80, 0.62),
        (0.98, 0.55),
        (0.60, 0.70),
    ]
    .map(|(x, y)| at(x, y, 0.0))
    .to_vec()
}

/// The side of the triangle of [`four`] and [`eight`], from its middle to a corner, metres.
const CORNER: f64 = 0.7;

/// Three who face their middle, with their first at `first` around it.
fn three(x: f64, y: f64, first: f64) -> People {
    let person = |i: u32| {
        let angle = first + TAU * f64::from(i) / 3.0;
        at(
            x + CORNER * angle.cos(),
            y + CORNER * angle.sin(),
            angle + PI,
        )
    };
    (0..3).map(person).collect()
}

/// Four of whom the third stands outside of the triangle of the others, and looks there (0) or away (half a turn).
fn four(third: f64) -> People {
    let mut people = three(0.0, 0.0, 0.0);
    people.insert(2, at(-0.9, 0.0, third));
    people
}

/// Eight people: two triangles, and one beside each who looks there.
fn eight() -> People {
    let mut people = four(0.0);
    people.extend(
        four(0.0)
            .iter()
            .map(|pose| Isometry2::translation(6.0, 0.0) * pose),
    );
    people
}

/// The centre of mass of a triangle of people.
fn centre(corners: [Isometry2<f64>; 3]) -> Point2<f64> {
    let sum: Vector2<f64> = corners.iter().map(|pose| pose.translation.vector).sum();
    Point2::from(sum / 3.0)
}

/// The four groups of Fig. 15: mood, its value, and members who stand each in their own way.
fn moods() -> [(&'static str, f64, People); 4] {
    [
        (
            "sad",
            0.56,
            vec![
                at(0.0, 0.6, -FRAC_PI_2),
                at(0.8, 0.0, PI),
                at(-0.8, 0.0, 0.0),
            ],
        ),
        ("neutral", 0.7, three(8.0, 0.0, FRAC_PI_2)),
        (
            "disgusted",
            0.28,
            vec![
                at(0.0, -7.4, -FRAC_PI_2),
                at(0.5, -8.4, FRAC_PI_2 + 0.4),
                at(-0.5, -8.4, FRAC_PI_2 - 0.4),
            ],
        ),
        ("happy", 0.98, three(8.0, -8.0, 0.3)),
    ]
}

/// The influences of Fig. 15: ahead .6, to either side .4, behind .3.
const INFLUENCE: Influence = Influence {
    front: 0.6,
    left: 0.4,
    rear: 0.3,
    right: 0.4,
};
const MOOD: &str = "emotional_state";

fn mood() -> Features {
    let feature = Feature {
        influence: INFLUENCE,
        ..Feature::default()
    };
    Features {
        known: BTreeMap::from([(MOOD.to_owned(), feature)]),
        ..Features::default()
    }
}

fn row(label: impl Into<String>, ours: String, claim: Cell, note: Option<&'static str>) -> Row {
    Row {
        label: label.into(),
        cells: vec![Cell::text(ours), claim],
        note,
    }
}

/// `says` where it `holds`.
fn claim(holds: bool, says: &'static str) -> Cell {
    Cell::texts(if holds { says } else { "not so" }, says)
}

fn by_distance() -> Result<Vec<Row>, Failure> {
    let all = strict(&ten(), 2.0, 0.0)?;
    let (wide, narrow) = (strict(&ten(), 0.40, 0.0)?, strict(&ten(), 0.32, 0.0)?);
    Ok(vec![
        row(
            "11a, no d_max",
            shown(&all),
            claim(
                all.len() == 1 && all[0].len() == 10,
                "one mesh connects all ten people",
            ),
            None,
        ),
        row(
            "11b, d_max .40",
            shown(&wide),
            claim(
                wide.len() == 2 && wide != all,
                "connections dropped: two groups, A and B",
            ),
            None,
        ),
        row(
            "11c, d_max .32",
            shown(&narrow),
            claim(
                narrow != wide,
                "a smaller distance gives another classification",
            ),
            None,
        ),
    ])
}

fn by_orientation() -> Result<Vec<Row>, Failure> {
    let (away, there) = (strict(&four(PI), 2.0, 0.4)?, strict(&four(0.0), 2.0, 0.4)?);
    let eight = eight();
    let groups = strict(&eight, 2.0, 0.4)?;
    // The centre of mass is of three corners: as far from each of a triangle of equal sides.
    let triangle = [eight[0], eight[1], eight[3]];
    let middle = centre(triangle);
    let even = triangle.iter().all(|pose| {
        let far = (pose.translation.vector - middle.coords).norm();
        (far - CORNER).abs() < 1e-9
    });
    let pair = strict(&[at(0.0, 0.0, 0.0), at(0.8, 0.0, PI)], 2.0, 0.4)?;
    let in_group = |groups: &Groups| groups.iter().flatten().any(|member| *member == 2);
    Ok(vec![
        row(
            "12a, person 3 looks away",
            shown(&away),
            claim(
                away.len() == 1 && !in_group(&away),
                "person 3 is not part of the group",
            ),
            None,
        ),
        row(
            "12b, person 3 looks there",
            shown(&there),
            claim(
                there.len() == 1 && in_group(&there),
                "person 3 is a member of this group",
            ),
            None,
        ),
        row(
            "12c, eight people",
            shown(&groups),
            claim(
                even && groups.iter().flatten().count() == 8,
                "n_p = 8; each triangle has a centre of mass",
            ),
            None,
        ),
        row(
            "two face to face",
            shown(&pair),
            Cell::text("(not in the paper)"),
            Some("READING.md 19: three are the least; `facing` is the default method"),
        ),
    ])
}

fn spaces() -> Result<Vec<Row>, Failure> {
    let everybody: People = moods()
        .into_iter()
        .flat_map(|(_, _, people)| people)
        .collect();
    let found = Grouping::default()
        .groups(&everybody)
        .map_err(Failure::internal)?;
    let by_mood: Vec<Vec<usize>> = (0..4)
        .map(|group| (3 * group..3 * group + 3).collect())
        .collect();
    let mut rows = vec![row(
        "15, groups",
        shown(&found),
        claim(found == by_mood, "four groups are formed"),
        None,
    )];
    let mut fronts: Vec<(f64, f64)> = Vec::new();
    let mut own = true;
    for (name, value, people) in moods() {
        let entity = GroupEntity::new(&people)
            .ok_or_else(|| Failure::internal("a group of three has no place"))?;
        let values = BTreeMap::from([(MOOD.to_owned(), value)]);
        let plain = entity.widths(&FourSided::HALL);
        let widths = mood().apply(plain, &values);
        let sides = widths.sides().map(|side| format!("{side:.2}"));
        // Of sigma^2 ahead, what the mood leaves.
        let share = (widths.front / plain.front).powi(2);
        rows.push(row(
            format!("15, {name}: widths f l b r"),
            sides.join(" "),
            Cell::nothing(),
            None,
        ));
        rows.push(row(
            format!("15, {name}: left of sigma^2 ahead"),
            format!("{share:.3}"),
            Cell::nothing(),
            None,
        ));
        let heading: Vector2<f64> = people.iter().map(|pose| pose.rotation * Vector2::x()).sum();
        let faces = entity.world_from_group.rotation.angle();
        if heading.norm() > 0.1 * people.len() as f64 {
            let mean = (faces - heading.y.atan2(heading.x)).abs() < 1e-9;
            rows.push(row(
                format!("15, {name}: orientation"),
                format!("{faces:.2}"),
                claim(mean, "mean of the members'"),
                None,
            ));
        } else {
            rows.push(row(
                format!("15, {name}: orientation"),
                format!("{faces:.2}"),
                Cell::texts("towards the first", "mean of the members'"),
                Some("READING.md 20: they face each other and no mean exists; the group faces its first member"),
            ));
        }
        fronts.push((value, share));
        let individual = mood().apply(FourSided::HALL, &values);
        let sides = widths.sides().into_iter().zip(individual.sides());
        own = own
            && sides
                .into_iter()
                .any(|(ours, theirs)| (ours - theirs).abs() > 1e-6);
    }
    fronts.sort_by(|a, b| a.0.total_cmp(&b.0));
    let smaller = fronts.windows(2).all(|pair| pair[1].1 < pair[0].1);
    rows.push(row(
        "15, moods",
        String::new(),
        claim(smaller, "the happier, the smaller (Fig. 14a's rule)"),
        None,
    ));
    rows.push(row(
        "15, shapes",
        String::new(),
        claim(own, "unlike an individual's: members' places shape it, too"),
        None,
    ));
    Ok(rows)
}

pub(super) fn groups() -> Result<Table, Failure> {
    let rows = [by_distance()?, by_orientation()?, spaces()?];
    Ok(Table {
        columns: vec!["ours", "the paper says"],
        rows: rows.into_iter().flatten().collect(),
        notes: vec![
            "The figures print no coordinates: the arrangements are ours, and what the text says comes of them is compared; \
             `--pictures DIR` draws them.\nFig. 15 has widths ahead, left, behind and right in metres, with the figure's \
             influences (.6 .4 .3 .4, preset positive_is_closer, READING.md 4).",
            "Own decision: lengths of Fig. 11 are shares of the picture's side, as printed (p.u.); the vectors of eq. 2, of \
             which no length is printed, are 0.4 m.",
        ],
    })
}

/// Figs 11b, 11c, 12 and 15 as ours are.
pub(super) fn pictures() -> Result<Vec<Drawn>, Failure> {
    // The picture's side taken for so many metres, so that people's own spaces do not fill it.
    const SIDE: f64 = 10.0;
    let placed = |people: &People, features: &BTreeMap<String, f64>, first: usize| {
        let one = |(at, pose): (usize, &Isometry2<f64>)| {
            ((first + at + 1).to_string(), *pose, features.clone())
        };
        people.iter().enumerate().map(one).collect::<Vec<_>>()
    };
    let nothing = BTreeMap::new();
    let with = |grouping: Grouping| SocialConfig {
        grouping,
        ..SocialConfig::default()
    };
    let ten: People = ten()
        .iter()
        .map(|pose| Isometry2::from_parts((SIDE * pose.translation.vector).into(), pose.rotation))
        .collect();
    let mut pictures = Vec::new();
    for (name, longest) in [("tg-fig11b", 0.40), ("tg-fig11c", 0.32)] {
        let config = with(rules(SIDE * longest, 0.0));
        pictures.push(draw(name, &placed(&ten, &nothing, 0), &config)?);
    }
    for (name, people) in [
        ("tg-fig12a", four(PI)),
        ("tg-fig12b", four(0.0)),
        ("tg-fig12c", eight()),
    ] {
        let config = with(rules(2.0, 0.4));
        pictures.push(draw(name, &placed(&people, &nothing, 0), &config)?);
    }
    let config = SocialConfig {
        features: mood(),
        ..SocialConfig::default()
    };
    let mut everybody = Vec::new();
    for (_, value, people) in moods() {
        let values = BTreeMap::from([(MOOD.to_owned(), value)]);
        everybody.extend(placed(&people, &values, everybody.len()));
    }
    pictures.push(draw("tg-fig15", &everybody, &config)?);
    Ok(pictures)
}
