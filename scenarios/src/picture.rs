//! The picture of a run: the map, the people with their zones at one moment, both paths of the
//! robot, and the figures that go with them. This file owns what is drawn over what; the text of
//! the picture is a function of what is drawn, to the byte.
//!
//! Everything comes in in the world frame, SI units and radians.

mod canvas;
mod label;
mod legend;
mod map;
mod path;
mod people;
mod png;
mod social;
mod surface;
#[cfg(test)]
mod tests;

pub use png::{PngError, png};
pub use social::{Show, social};
pub use surface::Surface;

use crate::metrics::{Encounter, Metrics, ObjectSpace, closest_encounter, in_order};
use crate::scenario::Scenario;
use crate::world::Truth;
use canvas::{INK, View, number, text};
use dsr::Time;
use label::Labels;
use legend::Legend;
use svg::Document;
use svg::node::element::{ClipPath, Definitions, Group, Rectangle};

/// Room for the map, px.
const MAP: [f64; 2] = [860.0, 720.0];
/// Height of the lines above the map, px.
const TITLE: f64 = 62.0;
/// Around everything, px.
const BORDER: f64 = 20.0;
/// Around what the scenario's bounds enclose, m.
const MARGIN: f64 = 0.25;

/// What to draw.
#[derive(Debug, Clone, Copy)]
pub struct Picture<'a> {
    /// The world.
    pub scenario: &'a Scenario,
    /// The spaces of its objects.
    pub spaces: &'a [ObjectSpace],
    /// The run's seed.
    pub seed: u64,
    /// The run.
    pub run: Run<'a>,
    /// The same without social behaviour, where there was one.
    pub baseline: Option<Run<'a>>,
    /// The moment at which people are shown; `None` for the closest encounter of the run.
    pub at: Option<Time>,
}

/// One run of the scenario.
#[derive(Debug, Clone, Copy)]
pub struct Run<'a> {
    /// Whether the robot behaved socially.
    pub social: bool,
    /// Whether every mission succeeded.
    pub success: bool,
    /// What happened.
    pub samples: &'a [Truth],
    /// Its figures.
    pub metrics: &'a Metrics,
}

/// The moment that the picture shows.
struct Moment<'a> {
    sample: &'a Truth,
    /// Seconds since the run began.
    elapsed: f64,
    /// Where the moment is the closest encounter.
    encounter: Option<Encounter>,
}

impl<'a> Picture<'a> {
    /// The picture as SVG 1.1. Its text needs a sans-serif font; [`png`] brings its own.
    pub fn svg(&self) -> String {
        let samples = in_order(self.run.samples);
        let moment = self.moment(&samples);
        let view = View::new(self.scenario.bounds, MARGIN, [BORDER, TITLE + BORDER], MAP);
        let [map_width, map_height] = view.size();
        let left = BORDER + map_width + BORDER;
        let legend = Legend::new(self, moment.as_ref());
        let (column, column_height) = legend.draw([left, TITLE + BORDER]);
        let width = number(left + legend::WIDTH + BORDER);
        let below = column_height.max(map_height + canvas::SCALE_BAR);
        let height = number(TITLE + BORDER + below + BORDER);

        let clip = ClipPath::new().set("id", "map").add(view.frame());
        let page = Rectangle::new()
            .set("width", "100%")
            .set("height", "100%")
            .set("fill", "#ffffff");
        let document = Document::new()
            .set("viewBox", format!("0 0 {width} {height}"))
            .set("width", width)
            .set("height", height)
            .set("font-family", canvas::FONT)
            .add(Definitions::new().add(clip).add(legend::gradient()))
            .add(page)
            .add(self.title())
            .add(self.map(&view, &samples, moment.as_ref()))
            .add(view.frame().set("fill", "none").set("stroke", "#999999"))
            .add(view.scale_bar())
            .add(column);
        format!("{document}\n")
    }

    /// Everything on the map, the lowest first.
    fn map(&self, view: &View, samples: &[&Truth], moment: Option<&Moment>) -> Group {
        let mut labels = Labels::new(view);
        let now = moment.map_or(self.scenario.start, |moment| moment.sample.time);
        let mut group = Group::new()
            .set("clip-path", "url(#map)")
            .add(map::ground(view, self.scenario))
            .add(map::spaces(view, self.spaces, now))
            .add(map::walls(view, self.scenario))
            .add(map::objects(view, self.scenario))
            .add(people::trails(view, samples));
        if let Some(moment) = moment {
            group = group.add(people::zones(view, moment.sample));
        }
        for run in [self.baseline, Some(self.run)].into_iter().flatten() {
            group = group.add(path::path(view, run, &mut labels));
        }
        if let Some(moment) = moment {
            let radius = self.scenario.robot.radius;
            group = group.add(people::moment(view, moment, radius, &mut labels));
        }
        path::label_times(view, self.run, true, &mut labels);
        if let Some(baseline) = self.baseline {
            // Both begin at one place.
            path::label_times(view, baseline, false, &mut labels);
        }
        map::label_all(view, self.scenario, self.spaces, &mut labels);
        group.add(labels.draw())
    }

    /// The sample to show, if there is any.
    fn moment(&self, samples: &[&'a Truth]) -> Option<Moment<'a>> {
        let first = samples.first()?;
        let encounter = match self.at {
            Some(_) => None,
            None => closest_encounter(self.run.samples, self.scenario.robot.radius),
        };
        let wanted = self.at.or(encounter.as_ref().map(|e| e.time));
        let index = wanted.map_or(samples.len(), |time| {
            samples.partition_point(|sample| sample.time <= time)
        });
        let sample = samples[index.max(1) - 1];
        Some(Moment {
            sample,
            elapsed: sample.time.since(first.time),
            encounter,
        })
    }

    fn title(&self) -> Group {
        let intrusion = |run: &Run| {
            run.metrics.psi.map(|psi| {
                let share = psi.intimate + psi.personal;
                format!("{share:.1} % {}", canvas::behaviour(run.social))
            })
        };
        let shares: Vec<String> = [Some(self.run), self.baseline]
            .iter()
            .flatten()
            .filter_map(intrusion)
            .collect();
        let mut group = Group::new();
        if !shares.is_empty() {
            let line = format!(
                "Time in somebody's intimate or personal space: {}",
                shares.join(", ")
            );
            group = group.add(text(BORDER, BORDER + 40.0, &line, 13.0).set("fill", INK));
        }
        let name = format!("{}, seed {}", self.scenario.name, self.seed);
        let heading = text(BORDER, BORDER + 16.0, &name, 20.0)
            .set("font-weight", "bold")
            .set("fill", INK);
        group.add(heading)
    }
}
