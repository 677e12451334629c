//! Measuring social maps: people's density beside the plain way to draw it, updates beside full
//! rebuilds, crowds beside the time of a frame, outlines. It guarantees that what was updated step by
//! step equals, cell by cell, what is drawn anew.

mod windowed;

use super::quantity::Quantity;
use crate::Failure;
use agents::social_mapping::density::{DensityField, Source};
use agents::social_mapping::scene::{BODY_RADIUS, Manner, Person, SceneError};
use agents::social_mapping::{FourSided, Levels, SocialConfig, SocialMapper, SocialScene, Update};
use dsr::Time;
use nalgebra::{Isometry2, Point2, Vector2};
use std::hint::black_box;
use std::time::Instant;

/// Cells to a side, and their side in metres.
const CELLS: usize = 400;
const CELL: f64 = 0.05;
const SIDE: f64 = CELLS as f64 * CELL;
/// How often what takes milliseconds is done.
const RUNS: usize = 21;
/// One of 30 Hz, seconds.
const FRAME: f64 = 1.0 / 30.0;
/// A tenth of a second of walking, metres.
const STEP: f64 = 0.1;

/// All figures of social maps.
pub(crate) fn social() -> Result<Vec<Quantity>, Failure> {
    let mut quantities = Vec::new();
    densities(&mut quantities)?;
    quantities.push(contours());
    maps(&mut quantities)?;
    Ok(quantities)
}

fn quantity(name: &str, seconds: f64, beside: &str, peer_seconds: f64) -> Quantity {
    Quantity {
        peer: Some((peer_seconds * 1e3, false)),
        beside: beside.to_owned(),
        ..Quantity::new(name.to_owned(), seconds * 1e3, "ms")
    }
}

/// The median seconds of some runs; each has its own preparation, which does not count.
fn seconds<T>(runs: usize, mut prepare: impl FnMut() -> T, mut work: impl FnMut(T)) -> f64 {
    let mut nanoseconds: Vec<u64> = (0..runs)
        .map(|_| {
            let input = prepare();
            let started = Instant::now();
            work(input);
            started.elapsed().as_nanos() as u64
        })
        .collect();
    super::figure::median(&mut nanoseconds) * 1e-9
}

/// People spread evenly over a square, facing all ways: the same ones every time.
fn crowd(count: usize, side: f64) -> Vec<Isometry2<f64>> {
    // The plastic number's powers fill a square as evenly as a sequence can.
    const SPREAD: [f64; 2] = [0.754_877_666_246_692_8, 0.569_840_290_998_053_2];
    (0..count)
        .map(|i| {
            let [x, y] = SPREAD.map(|step| (0.5 + step * (i + 1) as f64).fract() * side);
            Isometry2::new(Vector2::new(x, y), i as f64 * 2.399_963)
        })
        .collect()
}

fn sources(poses: &[Isometry2<f64>]) -> Vec<Source> {
    let source = |pose: &Isometry2<f64>| Source {
        world_from_person: *pose,
        shape: FourSided::HALL,
    };
    poses.iter().map(source).collect()
}

fn field(people: &[Source]) -> DensityField {
    DensityField::new(Point2::origin(), CELL, [CELLS, CELLS], people)
}

/// Lets one person after the other step ahead, and back in the next round.
struct Walk(usize);

impl Walk {
    fn step(&mut self, count: usize) -> (usize, Isometry2<f64>) {
        let (round, index) = (self.0 / count, self.0 * 37 % count);
        self.0 += 1;
        let ahead = if round.is_multiple_of(2) { STEP } else { -STEP };
        (index, Isometry2::translation(ahead, 0.0))
    }
}

fn densities(quantities: &mut Vec<Quantity>) -> Result<(), Failure> {
    let hundred = crowd(100, SIDE);
    let (peer, peer_seconds) = windowed::peer(&hundred)?;
    let (few, many) = (sources(&hundred), sources(&crowd(1000, SIDE)));
    // Into memory that both have, as whoever draws again and again does.
    let mut drawn = field(&few);
    let mut draw = |people: &[Source]| {
        seconds(
            RUNS,
            || (),
            |()| {
                drawn.draw(black_box(people));
                black_box(&drawn);
            },
        )
    };
    let rebuild = draw(&few);
    quantities.push(quantity("density_100", rebuild, peer, peer_seconds));

    let (mut updated, mut people, mut walk) = (field(&few), few, Walk(0));
    let update = seconds(
        20 * RUNS,
        || {
            let (index, step) = walk.step(people.len());
            people[index].world_from_person *= step;
            (index, people[index])
        },
        |(index, source)| updated.update(index, &source),
    );
    if updated != field(&people) {
        let told = "a density that was updated differs from one drawn anew";
        return Err(Failure::internal(told));
    }
    let anew = seconds(RUNS, || (), |()| drop(black_box(field(black_box(&people)))));
    let rows = [
        (
            "density_100_one_moved",
            update,
            "drawing all anew into the same memory",
            rebuild,
        ),
        ("density_100_one_moved_new", update, "a new field", anew),
        ("density_1000", draw(&many), "a frame of 30 Hz", FRAME),
    ];
    quantities.extend(rows.map(|(name, ours, beside, peer)| quantity(name, ours, beside, peer)));
    Ok(())
}

/// The outlines of three zones of a hundred people.
fn contours() -> Quantity {
    let people = crowd(100, SIDE);
    let Levels {
        intimate,
        personal,
        social,
    } = Levels::default();
    let points = SocialConfig::default().contour_points;
    let outlines = || {
        for pose in &people {
            for level in [intimate, personal, social] {
                black_box(FourSided::HALL.contour(black_box(pose), level, points));
            }
        }
    };
    let ours = seconds(RUNS, || (), |()| outlines());
    quantity("contours_100", ours, "a millisecond", 1e-3)
}

/// A square hall with people.
fn hall(count: usize, side: f64) -> SocialScene {
    let corners =
        [(0.0, 0.0), (side, 0.0), (side, side), (0.0, side)].map(|(x, y)| Point2::new(x, y));
    let person = |(index, world_from_person)| Person {
        name: format!("person_{index}"),
        world_from_person,
        velocity: Vector2::zeros(),
        radius: BODY_RADIUS,
        manner: Manner::default(),
    };
    SocialScene {
        bounds: [0.0, 0.0, side, side],
        walls: (0..4).map(|i| [corners[i], corners[(i + 1) % 4]]).collect(),
        robot_radius: 0.25,
        social: true,
        people: crowd(count, side)
            .into_iter()
            .enumerate()
            .map(person)
            .collect(),
        ..SocialScene::default()
    }
}

/// A mapper that has drawn `scene`.
fn mapper(scene: &SocialScene) -> Result<SocialMapper, Failure> {
    let config = SocialConfig {
        resolution: CELL,
        ..SocialConfig::default()
    };
    let told = |problems: Vec<_>| {
        let problems: Vec<String> = problems.iter().map(ToString::to_string).collect();
        Failure::internal(problems.join("; "))
    };
    let mut mapper = SocialMapper::new(config).map_err(told)?;
    mapper
        .update(Time::default(), scene)
        .map_err(Failure::internal)?;
    Ok(mapper)
}

/// The whole map, as the agent makes it: layers, outlines and groups.
fn maps(quantities: &mut Vec<Quantity>) -> Result<(), Failure> {
    let mut fault: Option<SceneError> = None;
    let mut update = |mapper: &mut SocialMapper, scene: &SocialScene| -> Option<Update> {
        match mapper.update(Time::default(), black_box(scene)) {
            Ok(update) => Some(black_box(update)),
            Err(error) => {
                fault = Some(error);
                None
            }
        }
    };

    let (mut scene, mut walk) = (hall(100, SIDE), Walk(0));
    let mut updated = mapper(&scene)?;
    let one = seconds(
        2 * RUNS,
        || {
            let (index, step) = walk.step(scene.people.len());
            scene.people[index].world_from_person *= step;
            scene.clone()
        },
        |scene| drop(update(&mut updated, &scene)),
    );
    let fresh = || SocialMapper::new(updated.config().clone()).ok();
    let anew = seconds(RUNS, fresh, |mapper| {
        if let Some(mut mapper) = mapper {
            drop(update(&mut mapper, &scene));
        }
    });
    let grids = [updated.clone(), mapper(&scene)?]
        .map(|mut mapper| update(&mut mapper, &scene).map(|update| update.grid));
    if grids[0] != grids[1] {
        let told = "a map that was updated differs from one made anew";
        return Err(Failure::internal(told));
    }
    quantities.push(quantity("map_100_one_moved", one, "made anew", anew));

    let mut scene = hall(1000, 2.0 * SIDE);
    let (mut crowded, mut walk) = (mapper(&scene)?, Walk(0));
    let all = seconds(
        RUNS,
        || {
            for _ in 0..scene.people.len() {
                let (index, step) = walk.step(scene.people.len());
                scene.people[index].world_from_person *= step;
            }
            scene.clone()
        },
        |scene| drop(update(&mut crowded, &scene)),
    );
    quantities.push(quantity("map_1000", all, "a frame of 30 Hz", FRAME));
    match fault {
        Some(error) => Err(Failure::internal(error)),
        None => Ok(()),
    }
}
