//! The map in a terminal, as fine as its letters allow.

use crate::view::map::{Map, Place, Point};
use ratatui::Frame;
use ratatui::layout::Rect;
use ratatui::style::Color;
use ratatui::widgets::Block;
use ratatui::widgets::canvas::{Canvas, Circle, Context, Line};

/// A terminal's letters are about so many times as high as they are wide.
const TALL: f64 = 2.0;

pub(super) fn draw(map: &Map, frame: &mut Frame<'_>, area: Rect) {
    let [x0, y0, x1, y1] = bounds(map);
    let (wide, high) = (x1 - x0, y1 - y0);
    // As wide as high, whatever the area is.
    let columns = f64::from(area.width.saturating_sub(2).max(1));
    let rows = f64::from(area.height.saturating_sub(2).max(1)) * TALL;
    let scale = (wide / columns).max(high / rows);
    let [more_x, more_y] = [scale * columns - wide, scale * rows - high].map(|more| more / 2.0);
    let canvas = Canvas::default()
        .block(Block::bordered().title(title(map)))
        .x_bounds([x0 - more_x, x1 + more_x])
        .y_bounds([y0 - more_y, y1 + more_y])
        .paint(|context| paint(map, context));
    frame.render_widget(canvas, area);
}

fn title(map: &Map) -> String {
    let problems = match map.problems.len() {
        0 => String::new(),
        count => format!(
            ", {count} problems: {} {}",
            map.problems[0].node, map.problems[0].text
        ),
    };
    format!(
        "{} people, {} groups, {} objects{}",
        map.people.len(),
        map.groups.len(),
        map.objects.len(),
        problems.replace('\n', " ")
    )
}

fn bounds(map: &Map) -> [f64; 4] {
    let ends = map
        .walls
        .iter()
        .flat_map(|[a, b, c, d]| [[*a, *b], [*c, *d]]);
    let people = map.people.iter().map(|one| one.place);
    let robots = map.robots.iter().map(|one| one.place);
    let objects = map.objects.iter().map(|one| one.place);
    let things = people.chain(robots).chain(objects).map(|[x, y, _]| [x, y]);
    let start = [
        f64::INFINITY,
        f64::INFINITY,
        f64::NEG_INFINITY,
        f64::NEG_INFINITY,
    ];
    let found = ends.chain(things).fold(start, |[x0, y0, x1, y1], [x, y]| {
        [x0.min(x), y0.min(y), x1.max(x), y1.max(y)]
    });
    if found.iter().all(|side| side.is_finite()) {
        let [x0, y0, x1, y1] = found;
        [x0 - 0.5, y0 - 0.5, x1 + 0.5, y1 + 0.5]
    } else {
        [-5.0, -5.0, 5.0, 5.0]
    }
}

fn line(context: &mut Context<'_>, [x1, y1]: Point, [x2, y2]: Point, color: Color) {
    context.draw(&Line::new(x1, y1, x2, y2, color));
}

fn outline(context: &mut Context<'_>, points: &[Point], color: Color) {
    let next = points.iter().cycle().skip(1);
    for (from, to) in points.iter().zip(next) {
        line(context, *from, *to, color);
    }
}

fn standing(context: &mut Context<'_>, [x, y, heading]: Place, radius: f64, color: Color) {
    context.draw(&Circle {
        x,
        y,
        radius,
        color,
    });
    let nose = [
        x + 2.0 * radius * heading.cos(),
        y + 2.0 * radius * heading.sin(),
    ];
    line(context, [x, y], nose, color);
}

fn paint(map: &Map, context: &mut Context<'_>) {
    for [a, b, c, d] in &map.walls {
        line(context, [*a, *b], [*c, *d], Color::Gray);
    }
    for object in &map.objects {
        let costs = object.usage.is_some_and(|usage| usage > 2.0);
        let color = if costs { Color::Red } else { Color::Green };
        outline(context, &object.space, color);
    }
    for person in &map.people {
        outline(context, &person.zones[1], Color::Yellow);
        standing(context, person.place, person.radius, Color::Blue);
    }
    for group in &map.groups {
        outline(context, &group.outline, Color::Magenta);
    }
    context.layer();
    for robot in &map.robots {
        let [x, y, _] = robot.place;
        let mut from = [x, y];
        for to in &robot.path {
            line(context, from, *to, Color::Green);
            from = *to;
        }
        standing(context, robot.place, robot.radius, Color::Green);
    }
    context.layer();
    for room in &map.rooms {
        let count = room.outline.len().max(1) as f64;
        let sum = room
            .outline
            .iter()
            .fold([0.0; 2], |[a, b], [x, y]| [a + x, b + y]);
        context.print(sum[0] / count, sum[1] / count, room.name.clone());
    }
    let people = map.people.iter().map(|one| (&one.name, one.place));
    for (name, [x, y, _]) in people.chain(map.robots.iter().map(|one| (&one.name, one.place))) {
        context.print(x + 0.3, y + 0.3, name.clone());
    }
}
