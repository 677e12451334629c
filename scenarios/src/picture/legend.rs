//! The column beside the map: what the marks mean, and the figures of the runs. This file owns the
//! names of things; it explains nothing that is not on the map.

use super::canvas::{
    FAINT, HEAT, INK, PEOPLE, ROBOT, behaviour, cross, heat, line, number, rectangle, style, text,
};
use super::path::dot_interval;
use super::{Moment, Picture, Run};
use crate::metrics::{Metrics, Psi, RobotMetrics};
use svg::node::element::{Circle, Group, LinearGradient, Stop, Text};

/// Width of the column, px.
pub(super) const WIDTH: f64 = 270.0;
/// From line to line, px.
const LINE: f64 = 19.0;
/// Where text beside a mark begins, px.
const INDENT: f64 = 46.0;
/// Right edges of the two columns of figures, px.
const COLUMNS: [f64; 2] = [WIDTH - 82.0, WIDTH];

/// What the column says.
pub(super) struct Legend<'a> {
    runs: Vec<Run<'a>>,
    interval: f64,
    /// Seconds since the run began, and to the closest person, m, where it shows that.
    moment: Option<(f64, Option<f64>)>,
    people: usize,
    /// Least and most R(t) of the spaces, if there are any.
    usage: Option<[f64; 2]>,
}

/// The column so far, and where its next line goes.
struct Column {
    group: Group,
    left: f64,
    y: f64,
}

impl Column {
    fn add(&mut self, node: impl Into<Box<dyn svg::Node>>) {
        let group = std::mem::take(&mut self.group);
        self.group = group.add(node);
    }

    fn heading(&mut self, content: &str) {
        self.y += 8.0;
        let words = text(self.left, self.y, content, 13.0);
        self.add(words.set("font-weight", "bold").set("fill", INK));
        self.y += LINE;
    }

    fn words(&mut self, x: f64, content: &str, colour: &'static str) {
        self.add(text(self.left + x, self.y, content, 12.0).set("fill", colour));
    }

    /// A line of words with a mark before them.
    fn entry(&mut self, mark: Group, content: &str) {
        let shift = format!("translate({},{})", number(self.left), number(self.y - 4.0));
        self.add(mark.set("transform", shift));
        self.words(INDENT, content, INK);
        self.y += LINE;
    }

    fn right(&mut self, x: f64, content: &str) -> Text {
        text(self.left + x, self.y, content, 12.0).set("text-anchor", "end")
    }
}

impl<'a> Legend<'a> {
    pub(super) fn new(picture: &Picture<'a>, moment: Option<&Moment>) -> Self {
        let runs: Vec<_> = [Some(picture.run), picture.baseline]
            .into_iter()
            .flatten()
            .collect();
        let duration = |run: &Run| run.metrics.robot.map_or(0.0, |robot| robot.duration);
        let curves = picture
            .spaces
            .iter()
            .map(|space| [space.curve.least, space.curve.most]);
        Self {
            interval: runs
                .iter()
                .map(duration)
                .map(dot_interval)
                .fold(0.0, f64::max),
            people: picture.run.metrics.people.len(),
            moment: moment.map(|moment| {
                let clearance = moment
                    .encounter
                    .as_ref()
                    .map(|encounter| encounter.clearance);
                (moment.elapsed, clearance)
            }),
            usage: curves.reduce(|a, b| [a[0].min(b[0]), a[1].max(b[1])]),
            runs,
        }
    }

    /// The column with its upper left corner at `corner`, and its height.
    pub(super) fn draw(&self, corner: [f64; 2]) -> (Group, f64) {
        let mut column = Column {
            group: Group::new(),
            left: corner[0],
            y: corner[1] + 4.0,
        };
        self.robot(&mut column);
        self.people(&mut column);
        self.objects(&mut column);
        self.figures(&mut column);
        (column.group, column.y - corner[1])
    }

    fn robot(&self, column: &mut Column) {
        column.heading("Path of the robot");
        for run in &self.runs {
            let (colour, dashes) = style(run.social);
            let stroke = line(0.0, 0.0, 36.0, 0.0)
                .set("stroke", colour)
                .set("stroke-width", "2.4");
            let dot = circle(18.0, 3.2)
                .set("fill", "#ffffff")
                .set("stroke", colour)
                .set("stroke-width", "1.5");
            let mark = Group::new()
                .add(stroke.set("stroke-dasharray", dashes))
                .add(dot);
            let name = if run.social {
                "with social behaviour"
            } else {
                "without social behaviour"
            };
            column.entry(mark, name);
        }
        let colour = self.runs.first().map_or(INK, |run| style(run.social).0);
        let square = |x: f64, fill| {
            let square = rectangle(x, -5.5, 11.0, 11.0).set("fill", fill);
            square.set("stroke", colour).set("stroke-width", "2")
        };
        let squares = Group::new()
            .add(square(4.0, "#ffffff"))
            .add(square(21.0, colour));
        column.entry(squares, "start, end");
        if self
            .runs
            .iter()
            .any(|run| run.metrics.robot.is_some_and(|robot| robot.collisions > 0))
        {
            column.entry(Group::new().add(cross(18.0, 0.0, 5.0)), "collision");
        }
        column.words(INDENT, &format!("a dot every {} s", self.interval), FAINT);
        column.y += LINE;
    }

    fn people(&self, column: &mut Column) {
        let Some((elapsed, clearance)) = self.moment else {
            return;
        };
        column.heading(&format!("At {elapsed:.1} s"));
        if let Some(clearance) = clearance {
            let words = format!("closest encounter, bodies {clearance:.2} m apart");
            column.words(0.0, &words, FAINT);
            column.y += LINE;
        }
        let body = |colour| {
            circle(18.0, 7.0)
                .set("fill", colour)
                .set("stroke", INK)
                .set("stroke-width", "1.4")
        };
        let nose = || {
            line(18.0, 0.0, 25.0, 0.0)
                .set("stroke", INK)
                .set("stroke-width", "2")
        };
        column.entry(Group::new().add(body(ROBOT)).add(nose()), "robot");
        if self.people == 0 {
            return;
        }
        column.entry(Group::new().add(body(PEOPLE)).add(nose()), "person");
        let zone = |opacity, dashes| {
            let patch = rectangle(4.0, -7.0, 28.0, 13.0)
                .set("fill", PEOPLE)
                .set("fill-opacity", opacity);
            Group::new().add(patch.set("stroke", PEOPLE).set("stroke-dasharray", dashes))
        };
        column.entry(zone("0.62", "none"), "intimate zone");
        column.entry(zone("0.22", "none"), "personal zone");
        column.entry(zone("0.07", "3 3"), "social zone");
        let trail = line(0.0, 0.0, 36.0, 0.0)
            .set("stroke", PEOPLE)
            .set("stroke-width", "1.2")
            .set("stroke-opacity", "0.6");
        let all = format!("ways of all {} people", self.people);
        column.entry(
            Group::new().add(trail),
            if self.people == 1 {
                "that person's way"
            } else {
                &all
            },
        );
    }

    fn objects(&self, column: &mut Column) {
        let Some([least, most]) = self.usage else {
            return;
        };
        column.heading("Spaces of objects, R(t) at that time");
        let bar = rectangle(column.left, column.y - 10.0, 120.0, 12.0);
        column.add(
            bar.set("fill", "url(#usage)")
                .set("fill-opacity", "0.45")
                .set("stroke", "#999999"),
        );
        column.words(128.0, &format!("{least} to {most}"), INK);
        column.y += LINE;
        column.words(0.0, "from no activity near to in use", FAINT);
        column.y += LINE;
    }

    fn figures(&self, column: &mut Column) {
        column.heading("Figures");
        for (run, x) in self.runs.iter().zip(self.columns()) {
            let (colour, _) = style(run.social);
            let title = if run.social {
                "social"
            } else {
                behaviour(false)
            };
            let title = column
                .right(*x, title)
                .set("fill", colour)
                .set("font-weight", "bold");
            column.add(title);
        }
        column.y += LINE;
        column.words(0.0, "mission", INK);
        for (run, x) in self.runs.iter().zip(self.columns()) {
            let outcome = if run.success { "succeeded" } else { "failed" };
            let outcome = column.right(*x, outcome).set("fill", INK);
            column.add(outcome);
        }
        column.y += LINE;
        let robot =
            |figure: fn(&RobotMetrics) -> String| move |m: &Metrics| m.robot.as_ref().map(figure);
        let psi = |share: fn(&Psi) -> f64| {
            move |m: &Metrics| m.psi.map(|psi| format!("{:.1}", share(&psi)))
        };
        self.figure(
            column,
            "path length, m",
            robot(|robot| format!("{:.2}", robot.path_length)),
        );
        self.figure(
            column,
            "duration, s",
            robot(|robot| format!("{:.1}", robot.duration)),
        );
        self.figure(
            column,
            "CHC, rad",
            robot(|robot| format!("{:.2}", robot.chc)),
        );
        self.figure(
            column,
            "collisions",
            robot(|robot| robot.collisions.to_string()),
        );
        self.figure(column, "least distance, m", |metrics: &Metrics| {
            let least = metrics
                .people
                .iter()
                .map(|person| person.min_distance)
                .min_by(f64::total_cmp);
            least.map(|least| format!("{least:.2}"))
        });
        column.words(0.0, "share of time, %", FAINT);
        column.y += LINE;
        self.figure(column, "  intimate zone", psi(|psi| psi.intimate));
        self.figure(column, "  personal zone", psi(|psi| psi.personal));
        self.figure(column, "  social zone", psi(|psi| psi.social));
        self.figure(column, "  public space", psi(|psi| psi.public));
        self.figure(column, "  objects in use", psi(|psi| psi.objects));
    }

    fn figure(&self, column: &mut Column, label: &str, cell: impl Fn(&Metrics) -> Option<String>) {
        let name = label.trim_start();
        let indent = 6.0 * (label.len() - name.len()) as f64;
        column.words(indent, name, INK);
        for (run, x) in self.runs.iter().zip(self.columns()) {
            let value = cell(run.metrics).unwrap_or_else(|| "\u{2013}".to_owned());
            let value = column.right(*x, &value).set("fill", INK);
            column.add(value);
        }
        column.y += LINE;
    }

    /// Right edges of the figures of each run.
    fn columns(&self) -> &'static [f64] {
        &COLUMNS[2 - self.runs.len().min(2)..]
    }
}

fn circle(x: f64, radius: f64) -> Circle {
    Circle::new()
        .set("cx", number(x))
        .set("cy", 0)
        .set("r", number(radius))
}

/// The colours of R(t), for the bar.
pub(super) fn gradient() -> LinearGradient {
    let last = HEAT.len() - 1;
    (0..=last).fold(LinearGradient::new().set("id", "usage"), |gradient, i| {
        let share = i as f64 / last as f64;
        gradient.add(
            Stop::new()
                .set("offset", number(share))
                .set("stop-color", heat(share)),
        )
    })
}
