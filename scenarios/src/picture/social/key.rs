//! The column beside the picture of a situation: what its colours and lines mean. It explains nothing
//! that is not drawn.

use super::super::canvas::{FAINT, INK, PEOPLE, heat, line, number, rectangle, text, text_width};
use super::{GROUP, Show, cost_colour, curve, density_colour, is_crowd, known, passing};
use crate::situation::Situation;
use agents::social_mapping::{SocialConfig, Update, UsageCurve};
use std::cell::Cell;
use svg::node::element::Group;

/// From line to line, px.
const LINE: f64 = 20.0;

/// The column with its upper left corner at `corner`, px, and its width and height.
#[allow(clippy::too_many_lines, reason = "a column is read from top to bottom")]
pub(super) fn column(
    corner: [f64; 2],
    situation: &Situation,
    update: &Update,
    config: &SocialConfig,
    show: Show,
) -> (Group, [f64; 2]) {
    let [left, top] = corner;
    let widest = Cell::new(0.0f64);
    let mut y = top + 8.0;
    let mut column = Group::new();
    let words = |x: f64, y: f64, content: &str, colour: &'static str| {
        widest.set(widest.get().max(x + text_width(content, 12.0)));
        text(left + x, y, content, 12.0).set("fill", colour)
    };
    let heading = |y: f64, content: &str| {
        // Bold letters are wider.
        widest.set(widest.get().max(text_width(content, 14.0)));
        words(0.0, y, content, INK).set("font-weight", "bold")
    };
    let bar = |y: f64, colour: &dyn Fn(f64) -> String, ends: [&str; 2]| {
        const STEPS: u32 = 30;
        let piece = 150.0 / f64::from(STEPS);
        let pieces = (0..STEPS).fold(Group::new(), |group, i| {
            let share = (f64::from(i) + 0.5) / f64::from(STEPS);
            let x = left + f64::from(i) * piece;
            group.add(rectangle(x, y, piece + 0.3, 12.0).set("fill", colour(share)))
        });
        pieces
            .add(
                rectangle(left, y, 150.0, 12.0)
                    .set("fill", "none")
                    .set("stroke", "#999999"),
            )
            .add(words(0.0, y + 26.0, ends[0], FAINT))
            .add(words(150.0, y + 26.0, ends[1], FAINT).set("text-anchor", "end"))
    };
    match show {
        Show::Density => {
            let shape = config.proxemics.shape;
            column =
                column
                    .add(heading(y, "Density"))
                    .add(bar(y + 8.0, &density_colour, ["0", "1"]));
            y += 52.0;
            let widths = format!(
                "widths {:.2} / {:.2} / {:.2} m",
                shape.front, shape.side, shape.rear
            );
            column = column.add(words(0.0, y, &widths, FAINT)).add(words(
                0.0,
                y + 15.0,
                "ahead / to the sides / behind",
                FAINT,
            ));
            y += 15.0 + LINE;
        }
        Show::Costs(_) => {
            let colour = |share: f64| cost_colour((1.0 + 3.0 * share) as f32).unwrap_or_default();
            column = column.add(heading(y, "Cost of a place")).add(bar(
                y + 8.0,
                &colour,
                ["1, free", "4, personal"],
            ));
            y += 56.0;
            column = column
                .add(rectangle(left, y - 10.0, 28.0, 12.0).set("fill", "#4d4d4d"))
                .add(words(40.0, y, "blocked", INK));
            y += LINE;
        }
    }
    y += 6.0;
    let crowd = is_crowd(update);
    if !crowd {
        column = column.add(heading(y, "Edges of zones"));
        y += LINE;
    }
    let levels = &config.proxemics.levels;
    for (name, level, width, dashes) in [
        ("intimate", levels.intimate, "1.8", "none"),
        ("personal", levels.personal, "1.1", "none"),
        ("social", levels.social, "0.8", "4 3"),
    ]
    .into_iter()
    .filter(|_| !crowd)
    {
        let stroke = line(left, y - 4.0, left + 28.0, y - 4.0)
            .set("stroke", "#0b2f5b")
            .set("stroke-width", width)
            .set("stroke-dasharray", dashes);
        let level = (level * 1e4).round() / 1e4;
        let name = format!("{name}, density {level}");
        column = column.add(stroke).add(words(40.0, y, &name, INK));
        y += LINE;
    }
    if !crowd && passing::is_wanted(update) {
        let zone = rectangle(left, y - 10.0, 28.0, 12.0)
            .set("fill", passing::WANTED)
            .set("fill-opacity", "0.45");
        column = column
            .add(zone)
            .add(words(40.0, y, "cooperation zone", INK));
        y += LINE;
    }
    if !crowd && passing::is_shut(update) {
        let bar = line(left, y - 4.0, left + 28.0, y - 4.0)
            .set("stroke", passing::SHUT)
            .set("stroke-width", "4");
        column = column.add(bar).add(words(40.0, y, "no passage here", INK));
        y += LINE;
    }
    y += 6.0;
    let count = update.people.len();
    column = column.add(heading(
        y,
        &format!("People: {count}, groups: {}", update.groups.len()),
    ));
    y += LINE;
    if crowd {
        column = column.add(words(0.0, y, "too many to draw each", FAINT));
        y += LINE;
    } else {
        let body = svg::node::element::Circle::new()
            .set("cx", number(left + 14.0))
            .set("cy", number(y - 4.0))
            .set("r", 6)
            .set("fill", PEOPLE)
            .set("stroke", INK);
        column = column
            .add(body)
            .add(words(40.0, y, "person, facing", INK))
            .add(
                line(left + 14.0, y - 4.0, left + 28.0, y - 4.0)
                    .set("stroke", INK)
                    .set("stroke-width", "2"),
            );
        y += LINE;
    }
    if !crowd && !update.groups.is_empty() {
        let spoke = line(left, y - 4.0, left + 28.0, y - 4.0)
            .set("stroke", GROUP)
            .set("stroke-width", "2.2");
        column = column
            .add(spoke)
            .add(words(40.0, y, "belongs to a group", INK));
        y += LINE;
        let space = line(left, y - 4.0, left + 28.0, y - 4.0)
            .set("stroke", GROUP)
            .set("stroke-width", "1.4")
            .set("stroke-dasharray", "7 4");
        column = column
            .add(space)
            .add(words(40.0, y, "personal space of a group", INK));
        y += LINE;
    }
    let known = known::lines(situation, config);
    if !crowd && !known.is_empty() {
        y += 6.0;
        column = column.add(heading(y, "Known of people"));
        for known in &known {
            y += 16.0;
            column = column.add(words(0.0, y, known, INK));
        }
        y += LINE;
    }
    if !update.objects.is_empty() {
        y += 6.0;
        let ends = usage_ends(update, config);
        // On the grid, only the edge of a space tells R(t) by its colour.
        let (what, opacity) = match show {
            Show::Density => ("Spaces of objects, R(t)", "0.6"),
            Show::Costs(_) => ("Edges of objects' spaces, R(t)", "1"),
        };
        column = column
            .add(heading(y, what))
            .add(bar(y + 8.0, &heat, [&ends[0], &ends[1]]).set("fill-opacity", opacity));
        y += 56.0;
    }
    let left_out = update.rejected.len();
    if left_out > 0 {
        column = column.add(words(
            0.0,
            y,
            &format!("left out or mended: {left_out}"),
            FAINT,
        ));
        y += LINE;
    }
    let empty = situation.scene.people.is_empty() && situation.scene.objects.is_empty();
    if empty {
        column = column.add(words(0.0, y, "nobody and nothing is here", FAINT));
        y += LINE;
    }
    (column, [widest.get(), y - top])
}

/// What the ends of the colours of R(t) are: numbers where all objects have the same, words where not.
fn usage_ends(update: &Update, config: &SocialConfig) -> [String; 2] {
    let mut curves = update.objects.iter().map(|one| curve(config, one));
    let [least, most] = ["idle".to_owned(), "in use".to_owned()];
    let Some(first) = curves.next() else {
        return [least, most];
    };
    let same = |one: &UsageCurve| {
        one.least.to_bits() == first.least.to_bits() && one.most.to_bits() == first.most.to_bits()
    };
    if curves.all(same) {
        [
            format!("{} {least}", first.least),
            format!("{} {most}", first.most),
        ]
    } else {
        [least, most]
    }
}
