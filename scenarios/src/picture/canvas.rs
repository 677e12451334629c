//! From the world to the page. This file owns the scale and the look of what is drawn, and
//! guarantees that every number is written with at most two decimals.

use geo::Simplify;
use nalgebra::Point2;
use svg::node::element::{Circle, Group, Line, Polygon, Polyline, Rectangle, Text};

/// The font that [`super::png`] embeds, and what browsers have instead.
pub(super) const FONT: &str = "'DejaVu Sans', Verdana, sans-serif";
/// Text and walls.
pub(super) const INK: &str = "#222222";
/// What matters less.
pub(super) const FAINT: &str = "#777777";
/// People: Okabe and Ito's bluish green, which colour-blind readers tell from all others here.
pub(super) const PEOPLE: &str = "#009e73";
/// The robot at one moment.
pub(super) const ROBOT: &str = "#e69f00";
/// Where the robot ran into something.
pub(super) const COLLISION: &str = "#d55e00";
/// Ways are drawn to this accuracy, m.
const ACCURACY: f64 = 0.02;
/// Height of the scale bar below the map, px.
pub(super) const SCALE_BAR: f64 = 34.0;

/// How the path of a run is drawn: colour and dashes.
pub(super) fn style(social: bool) -> (&'static str, &'static str) {
    if social {
        ("#0072b2", "none")
    } else {
        ("#444444", "7 4")
    }
}

/// What a run is called.
pub(super) fn behaviour(social: bool) -> &'static str {
    if social {
        "with social behaviour"
    } else {
        "without"
    }
}

/// Where the world lies on the page.
#[derive(Debug, Clone)]
pub(super) struct View {
    /// xmin, ymin, xmax, ymax, m.
    bounds: [f64; 4],
    /// Upper left corner on the page, px.
    corner: [f64; 2],
    /// px per m.
    scale: f64,
}

impl View {
    /// `bounds` and `margin` metres around them, as large as fits into `most` px.
    pub(super) fn new(bounds: [f64; 4], margin: f64, corner: [f64; 2], most: [f64; 2]) -> Self {
        let [xmin, ymin, xmax, ymax] = bounds;
        let bounds = [xmin - margin, ymin - margin, xmax + margin, ymax + margin];
        let [width, height] = [bounds[2] - bounds[0], bounds[3] - bounds[1]];
        Self {
            bounds,
            corner,
            scale: (most[0] / width).min(most[1] / height),
        }
    }

    /// Width and height, px.
    pub(super) fn size(&self) -> [f64; 2] {
        let [xmin, ymin, xmax, ymax] = self.bounds;
        [(xmax - xmin) * self.scale, (ymax - ymin) * self.scale]
    }

    /// Left, top, right, bottom, px.
    pub(super) fn edges(&self) -> [f64; 4] {
        let ([left, top], [width, height]) = (self.corner, self.size());
        [left, top, left + width, top + height]
    }

    /// Where `point` is on the page, px.
    pub(super) fn page(&self, point: Point2<f64>) -> Point2<f64> {
        Point2::new(
            self.corner[0] + (point.x - self.bounds[0]) * self.scale,
            self.corner[1] + (self.bounds[3] - point.y) * self.scale,
        )
    }

    /// So many metres in px.
    pub(super) fn px(&self, metres: f64) -> f64 {
        metres * self.scale
    }

    pub(super) fn polygon(&self, points: impl IntoIterator<Item = Point2<f64>>) -> Polygon {
        Polygon::new().set("points", self.points(points))
    }

    pub(super) fn polyline(&self, points: impl IntoIterator<Item = Point2<f64>>) -> Polyline {
        Polyline::new()
            .set("points", self.points(points))
            .set("fill", "none")
            .set("stroke-linejoin", "round")
            .set("stroke-linecap", "round")
    }

    pub(super) fn line(&self, from: Point2<f64>, to: Point2<f64>) -> Line {
        let (from, to) = (self.page(from), self.page(to));
        line(from.x, from.y, to.x, to.y)
    }

    /// A disc of `radius` px.
    pub(super) fn dot(&self, centre: Point2<f64>, radius: f64) -> Circle {
        let centre = self.page(centre);
        Circle::new()
            .set("cx", number(centre.x))
            .set("cy", number(centre.y))
            .set("r", number(radius))
    }

    fn points(&self, points: impl IntoIterator<Item = Point2<f64>>) -> String {
        let pairs: Vec<String> = points
            .into_iter()
            .map(|point| self.page(point))
            .map(|point| format!("{},{}", number(point.x), number(point.y)))
            .collect();
        pairs.join(" ")
    }

    /// The map's outline.
    pub(super) fn frame(&self) -> Rectangle {
        let ([x, y], [width, height]) = (self.corner, self.size());
        rectangle(x, y, width, height)
    }

    /// A bar of a round length below the map, and the axes.
    pub(super) fn scale_bar(&self) -> Group {
        let wanted = 0.2 * self.size()[0] / self.scale;
        let length = [0.5, 1.0, 2.0, 5.0, 10.0, 20.0, 50.0]
            .into_iter()
            .rfind(|length| *length <= wanted)
            .unwrap_or(0.2);
        let [left, _, _, bottom] = self.edges();
        let (y, right) = (bottom + 14.0, left + self.px(length));
        let stroke = |line: Line| line.set("stroke", INK).set("stroke-width", "1.5");
        Group::new()
            .add(stroke(line(left, y, right, y)))
            .add(stroke(line(left, y - 4.0, left, y + 4.0)))
            .add(stroke(line(right, y - 4.0, right, y + 4.0)))
            .add(text(right + 8.0, y + 4.0, &format!("{length} m"), 12.0).set("fill", INK))
    }
}

pub(super) fn line(x1: f64, y1: f64, x2: f64, y2: f64) -> Line {
    Line::new()
        .set("x1", number(x1))
        .set("y1", number(y1))
        .set("x2", number(x2))
        .set("y2", number(y2))
}

pub(super) fn rectangle(x: f64, y: f64, width: f64, height: f64) -> Rectangle {
    Rectangle::new()
        .set("x", number(x))
        .set("y", number(y))
        .set("width", number(width))
        .set("height", number(height))
}

/// Two strokes across each other at (`x`, `y`), `size` px to each side.
pub(super) fn cross(x: f64, y: f64, size: f64) -> Group {
    let stroke = |dy: f64| line(x - size, y - dy, x + size, y + dy);
    let edge = || {
        Group::new()
            .set("stroke-linecap", "round")
            .add(stroke(size))
            .add(stroke(-size))
    };
    Group::new()
        .add(edge().set("stroke", "#ffffff").set("stroke-width", "5"))
        .add(edge().set("stroke", COLLISION).set("stroke-width", "2.6"))
}

/// A line of text whose baseline begins at (`x`, `y`).
pub(super) fn text(x: f64, y: f64, content: &str, size: f64) -> Text {
    Text::new(content)
        .set("x", number(x))
        .set("y", number(y))
        .set("font-size", number(size))
}

/// How wide a line of text is about, px: digits and small letters of the font take 0.6 em.
pub(super) fn text_width(content: &str, size: f64) -> f64 {
    0.6 * size * content.chars().count() as f64
}

/// A way to within a little, as few points as that takes.
pub(super) fn simplified(points: &[Point2<f64>]) -> Vec<Point2<f64>> {
    let line: geo::LineString = points.iter().map(|p| (p.x, p.y)).collect();
    let simple = line.simplify(ACCURACY);
    simple.coords().map(|c| Point2::new(c.x, c.y)).collect()
}

/// With at most two decimals, and zero without a sign.
pub(super) fn number(value: f64) -> String {
    let text = format!("{value:.2}");
    let text = text.trim_end_matches('0').trim_end_matches('.');
    if text == "-0" { "0" } else { text }.to_owned()
}

/// The colour of R(t) at `share` of the way from its least to its most: yellow over orange to red
/// (Brewer's `YlOrRd`, whose lightness falls all the way, so that it reads in grey, too).
pub(super) fn heat(share: f64) -> String {
    mix(&HEAT, share)
}

/// The colour at `share` of the way through evenly spaced colours.
pub(super) fn mix(colours: &[[u8; 3]; 5], share: f64) -> String {
    let last = colours.len() - 1;
    let place = share.clamp(0.0, 1.0) * last as f64;
    let index = (place.floor() as usize).min(last - 1);
    let between = place - index as f64;
    let mix = |channel: usize| {
        let [from, to] = [index, index + 1].map(|i| f64::from(colours[i][channel]));
        (from + (to - from) * between).round() as u8
    };
    format!("#{:02x}{:02x}{:02x}", mix(0), mix(1), mix(2))
}

/// Evenly spaced colours of R(t).
pub(super) const HEAT: [[u8; 3]; 5] = [
    [0xff, 0xf0, 0x9a],
    [0xfe, 0xcc, 0x5c],
    [0xfd, 0x8d, 0x3c],
    [0xf0, 0x3b, 0x20],
    [0xbd, 0x00, 0x26],
];

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_page_has_north_up_and_keeps_proportions() {
        let view = View::new([0.0, 0.0, 10.0, 5.0], 0.0, [20.0, 30.0], [500.0, 500.0]);
        assert_eq!(view.page(Point2::new(0.0, 5.0)), Point2::new(20.0, 30.0));
        assert_eq!(view.page(Point2::new(10.0, 0.0)), Point2::new(520.0, 280.0));
    }

    #[test]
    fn numbers_are_short_and_zero_has_no_sign() {
        let written = [1.0, 0.125, -0.001, 1234.5, -2.25].map(number);
        assert_eq!(written, ["1", "0.12", "0", "1234.5", "-2.25"]);
    }

    #[test]
    fn usage_runs_from_yellow_to_red() {
        assert_eq!(
            [0.0, 0.5, 1.0, 7.0, f64::NAN].map(heat)[..4],
            ["#fff09a", "#fd8d3c", "#bd0026", "#bd0026"]
        );
        assert_eq!(heat(0.125), "#ffde7b");
    }
}
