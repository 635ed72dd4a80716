//! Draws a chart: one routine, for SVG and for PNG.
//!
//! The routine speaks in the chart's 1200 × 700 units and the canvas multiplies them: an SVG keeps thirds of a
//! pixel, and a PNG is drawn three times as large and averaged down, which smooths lines and letters. Fonts
//! are compiled in; none is looked for on the system.

use super::chart::{Axis, Chart, thinned};
use crate::picture;
use plotters::backend::{BitMapBackend, DrawingBackend, SVGBackend};
use plotters::coord::Shift;
use plotters::drawing::{DrawingArea, IntoDrawingArea};
use plotters::element::{Circle, PathElement, Polygon, Rectangle};
use plotters::style::text_anchor::{HPos, Pos, VPos};
use plotters::style::{
    Color, FontDesc, FontFamily, FontStyle, RGBColor, ShapeStyle, TextStyle, register_font,
};

/// Size of a chart in pixels.
pub(super) const SIZE: (u32, u32) = (1200, 700);
/// Steps to a pixel while drawing.
const FINE: u32 = 3;
/// Stretches of the frame axis that a line has points for.
const COLUMNS: usize = 900;

const INK: RGBColor = RGBColor(0x22, 0x22, 0x22);
const FADED: RGBColor = RGBColor(0x5a, 0x5a, 0x5a);
const GRID: RGBColor = RGBColor(0xe2, 0xe2, 0xe2);
/// Colours that the colour-blind tell apart (Okabe and Ito 2008), the pale yellow left out.
const COLOURS: [RGBColor; 7] = [
    RGBColor(0x44, 0x44, 0x44),
    RGBColor(0x00, 0x72, 0xb2),
    RGBColor(0xd5, 0x5e, 0x00),
    RGBColor(0x00, 0x9e, 0x73),
    RGBColor(0xcc, 0x79, 0xa7),
    RGBColor(0xe6, 0x9f, 0x00),
    RGBColor(0x56, 0xb4, 0xe9),
];

/// The chart as an SVG document.
pub(super) fn svg(chart: &Chart) -> Result<String, String> {
    let mut text = String::new();
    let fine = (SIZE.0 * FINE, SIZE.1 * FINE);
    draw(chart, SVGBackend::with_string(&mut text, fine), true)?;
    // The view box keeps the fine steps; the size on the page is the chart's.
    let drawn = format!("width=\"{}\" height=\"{}\" viewBox", fine.0, fine.1);
    Ok(text.replacen(&drawn, &format!("width=\"{}\" height=\"{}\" viewBox", SIZE.0, SIZE.1), 1))
}

/// The chart as a PNG file.
pub(super) fn png(chart: &Chart) -> Result<Vec<u8>, String> {
    picture::encode(&pixels(chart)?, [SIZE.0, SIZE.1]).map_err(|e| e.to_string())
}

/// The chart's pixels, red, green and blue, row by row from the top.
fn pixels(chart: &Chart) -> Result<Vec<u8>, String> {
    let fine = (SIZE.0 * FINE, SIZE.1 * FINE);
    let mut large = vec![0u8; (fine.0 * fine.1 * 3) as usize];
    draw(chart, BitMapBackend::with_buffer(&mut large, fine), false)?;
    let (fine_row, row, n) = ((fine.0 * 3) as usize, (SIZE.0 * 3) as usize, FINE as usize);
    let mut sums = vec![0u32; row];
    let mut small = Vec::with_capacity(row * SIZE.1 as usize);
    for block in large.chunks_exact(fine_row * n) {
        sums.fill(0);
        for (i, value) in block.iter().enumerate() {
            let within = i % fine_row;
            sums[within / (3 * n) * 3 + within % 3] += u32::from(*value);
        }
        small.extend(sums.iter().map(|sum| ((sum + FINE * FINE / 2) / (FINE * FINE)) as u8));
    }
    Ok(small)
}

/// A point in the chart's units, from the upper left.
type At = [f64; 2];

/// A drawing area that takes the chart's units.
struct Canvas<'a, DB: DrawingBackend> {
    area: &'a DrawingArea<DB, Shift>,
    /// Whether the backend joins the pieces of a broken line well by itself.
    joins: bool,
}

impl<DB: DrawingBackend> Canvas<'_, DB> {
    fn at(&self, [x, y]: At) -> (i32, i32) {
        let fine = |v: f64| (v * f64::from(FINE)).round() as i32;
        (fine(x), fine(y))
    }

    fn style(&self, colour: RGBColor, width: f64) -> ShapeStyle {
        ShapeStyle {
            color: colour.to_rgba(),
            filled: false,
            stroke_width: (width * f64::from(FINE)).round() as u32,
        }
    }

    fn line(&self, points: &[At], colour: RGBColor, width: f64) -> Result<(), String> {
        let style = self.style(colour, width);
        let mut fine: Vec<(i32, i32)> = points.iter().map(|p| self.at(*p)).collect();
        fine.dedup();
        if self.joins && fine.len() > 1 {
            return self.area.draw(&PathElement::new(fine, style)).map_err(|e| e.to_string());
        }
        // Straight pieces with round ends: no spikes where a line turns back sharply.
        for pair in fine.windows(2) {
            self.area.draw(&PathElement::new(pair.to_vec(), style)).map_err(|e| e.to_string())?;
        }
        let radius = (style.stroke_width / 2) as i32;
        for point in fine.iter().filter(|_| radius > 1 && points.len() != 2) {
            self.area.draw(&Circle::new(*point, radius, colour.filled())).map_err(|e| e.to_string())?;
        }
        Ok(())
    }

    fn dashes(&self, from: At, to_x: f64, colour: RGBColor) -> Result<(), String> {
        let mut x = from[0];
        while x < to_x {
            self.line(&[[x, from[1]], [(x + 9.0).min(to_x), from[1]]], colour, 1.4)?;
            x += 15.0;
        }
        Ok(())
    }

    fn marker(&self, [x, y]: At, look: usize) -> Result<(), String> {
        let colour = colour(look).filled();
        let shape = |offsets: &[At]| -> Vec<(i32, i32)> {
            offsets.iter().map(|[dx, dy]| self.at([x + dx, y + dy])).collect()
        };
        let drawn = match look % 4 {
            1 => self.area.draw(&Circle::new(self.at([x, y]), 6 * FINE as i32, colour)),
            2 => self
                .area
                .draw(&Polygon::new(shape(&[[-5.5, -5.5], [5.5, -5.5], [5.5, 5.5], [-5.5, 5.5]]), colour)),
            3 => self.area.draw(&Polygon::new(shape(&[[0.0, -7.5], [7.0, 5.0], [-7.0, 5.0]]), colour)),
            _ => self
                .area
                .draw(&Polygon::new(shape(&[[0.0, -8.0], [8.0, 0.0], [0.0, 8.0], [-8.0, 0.0]]), colour)),
        };
        drawn.map_err(|e| e.to_string())
    }

    /// Text whose letters are `em` units high, anchored at `at`.
    fn text(
        &self,
        text: &str,
        at: At,
        em: f64,
        colour: RGBColor,
        (h, v): (HPos, VPos),
    ) -> Result<(), String> {
        let style = font(em).color(&colour).pos(Pos::new(h, v));
        // In pictures the library centres the letters' box, descenders left out, a fifth of a letter too high.
        let down = if !self.joins && matches!(v, VPos::Center) { 0.2 * em } else { 0.0 };
        self.area.draw_text(text, &style, self.at([at[0], at[1] + down])).map_err(|e| e.to_string())
    }

    /// Width of `text` in units, with room for a font wider than the one compiled in.
    fn width(&self, text: &str, em: f64) -> Result<f64, String> {
        let style: TextStyle<'_> = font(em).color(&INK);
        let (width, _) = self.area.estimate_text_size(text, &style).map_err(|e| e.to_string())?;
        Ok(1.15 * f64::from(width) / f64::from(FINE))
    }

    /// `text`, shortened to fit into `room` units.
    fn fitted(&self, text: &str, em: f64, room: f64) -> Result<String, String> {
        let clean: String = terrasoar_layout::printable::line(text).chars().take(400).collect();
        let mut short = clean;
        let mut whole = true;
        loop {
            let shown = if whole { short.clone() } else { format!("{}…", short.trim_end()) };
            if short.is_empty() || self.width(&shown, em)? <= room {
                return Ok(shown);
            }
            short.pop();
            whole = false;
        }
    }
}

/// The compiled-in font with letters `em` units high; the library's sizes are line heights.
fn font(em: f64) -> FontDesc<'static> {
    FontDesc::new(FontFamily::SansSerif, em * 1.24 * f64::from(FINE), FontStyle::Normal)
}

fn colour(look: usize) -> RGBColor {
    COLOURS[look % COLOURS.len()]
}

/// The plotting area's edges in the chart's units.
struct Frame {
    left: f64,
    right: f64,
    top: f64,
    bottom: f64,
}

impl Frame {
    fn x(&self, part: f64) -> f64 {
        self.left + part * (self.right - self.left)
    }

    fn y(&self, part: f64) -> f64 {
        self.bottom - part * (self.bottom - self.top)
    }
}

fn draw<DB: DrawingBackend>(chart: &Chart, backend: DB, joins: bool) -> Result<(), String> {
    register_font("sans-serif", FontStyle::Normal, epaint_default_fonts::UBUNTU_LIGHT)
        .map_err(|_| "the compiled-in font cannot be read".to_owned())?;
    let area = backend.into_drawing_area();
    let canvas = Canvas { area: &area, joins };
    let (width, height) = (f64::from(SIZE.0), f64::from(SIZE.1));
    area.draw(&Rectangle::new([(0, 0), canvas.at([width, height])], RGBColor(255, 255, 255).filled()))
        .map_err(|e| e.to_string())?;
    let edge = 32.0;
    let title = canvas.fitted(&chart.title, 26.0, width - 2.0 * edge)?;
    canvas.text(&title, [edge, 22.0], 26.0, INK, (HPos::Left, VPos::Top))?;
    let subtitle = canvas.fitted(&chart.subtitle, 15.0, width - 2.0 * edge)?;
    canvas.text(&subtitle, [edge, 58.0], 15.0, FADED, (HPos::Left, VPos::Top))?;
    let below = draw_legend(chart, &canvas, edge, 98.0, width - edge)?;

    let mut label_room: f64 = 16.0;
    for (_, name) in &chart.references {
        label_room = label_room.max(canvas.width(name, 14.0)?.min(220.0));
    }
    let x = Axis::of(&chart.x, chart.series.iter().flat_map(|s| &s.points).map(|p| p[0]), false);
    let y = Axis::of(&chart.y, chart.series.iter().flat_map(|s| &s.points).map(|p| p[1]), true);
    let mut tick_room: f64 = 30.0;
    for (_, label) in &y.ticks {
        tick_room = tick_room.max(canvas.width(label, 15.0)?);
    }
    let frame = Frame {
        left: edge + tick_room + 10.0,
        right: width - edge - label_room,
        top: below + 44.0,
        bottom: height - 76.0,
    };
    let y_name = canvas.fitted(&chart.y.name, 16.0, width - 2.0 * edge)?;
    canvas.text(&y_name, [edge, below + 10.0], 16.0, INK, (HPos::Left, VPos::Top))?;
    let x_name = canvas.fitted(&chart.x.name, 16.0, width - 2.0 * edge)?;
    canvas.text(&x_name, [frame.x(0.5), height - 34.0], 16.0, INK, (HPos::Center, VPos::Top))?;
    draw_axes(&canvas, &frame, &x, &y)?;
    draw_references(chart, &canvas, &frame, &y)?;
    let drawn = draw_series(chart, &canvas, &frame, &x, &y)?;
    if drawn == 0 {
        let middle = [frame.x(0.5), frame.y(0.5)];
        let text = "No data: this takes two frames or more, and a second engine to compare";
        canvas.text(text, middle, 20.0, FADED, (HPos::Center, VPos::Center))?;
    }
    area.present().map_err(|e| e.to_string())
}

/// Draws the legend above the plot, in as many rows as it takes, and gives where it ends.
fn draw_legend<DB: DrawingBackend>(
    chart: &Chart,
    canvas: &Canvas<'_, DB>,
    left: f64,
    top: f64,
    right: f64,
) -> Result<f64, String> {
    let (sample, gap, row) = (34.0, 30.0, 26.0);
    let (mut x, mut y) = (left, top);
    for series in &chart.series {
        let name = canvas.fitted(&series.name, 16.0, 320.0)?;
        let needed = sample + 10.0 + canvas.width(&name, 16.0)?;
        if x > left && x + needed > right {
            (x, y) = (left, y + row);
        }
        let middle = y + 8.0;
        canvas.line(&[[x, middle], [x + sample, middle]], colour(series.look), 4.0)?;
        if chart.marked {
            canvas.marker([x + 0.5 * sample, middle], series.look)?;
        }
        canvas.text(&name, [x + sample + 10.0, middle], 16.0, INK, (HPos::Left, VPos::Center))?;
        x += needed + gap;
    }
    Ok(if chart.series.is_empty() { top - 14.0 } else { y + row })
}

fn draw_axes<DB: DrawingBackend>(
    canvas: &Canvas<'_, DB>,
    frame: &Frame,
    x: &Axis,
    y: &Axis,
) -> Result<(), String> {
    for (value, label) in &y.ticks {
        let Some(part) = y.place(*value) else { continue };
        let at = frame.y(part);
        canvas.line(&[[frame.left, at], [frame.right, at]], GRID, 1.0)?;
        canvas.text(label, [frame.left - 10.0, at], 15.0, FADED, (HPos::Right, VPos::Center))?;
    }
    // A label that would touch the one before it is left out; its grid line stays.
    let mut free_from = f64::NEG_INFINITY;
    for (value, label) in &x.ticks {
        let Some(part) = x.place(*value) else { continue };
        let at = frame.x(part);
        canvas.line(&[[at, frame.top], [at, frame.bottom]], GRID, 1.0)?;
        let half = 0.5 * canvas.width(label, 15.0)?;
        if at - half > free_from {
            canvas.line(&[[at, frame.bottom], [at, frame.bottom + 6.0]], FADED, 1.0)?;
            canvas.text(label, [at, frame.bottom + 12.0], 15.0, FADED, (HPos::Center, VPos::Top))?;
            free_from = at + half + 8.0;
        }
    }
    let corner = [frame.left, frame.bottom];
    canvas.line(&[corner, [frame.right, frame.bottom]], FADED, 1.4)?;
    canvas.line(&[[frame.left, frame.top], corner], FADED, 1.4)
}

/// Draws the reference lines with their names beside the plot, where no data are, moved apart if need be.
fn draw_references<DB: DrawingBackend>(
    chart: &Chart,
    canvas: &Canvas<'_, DB>,
    frame: &Frame,
    y: &Axis,
) -> Result<(), String> {
    let mut named: Vec<(f64, &str)> = chart
        .references
        .iter()
        .filter_map(|(v, name)| Some((frame.y(y.place(*v)?), name.as_str())))
        .collect();
    named.sort_by(|a, b| b.0.total_cmp(&a.0));
    let mut ceiling = f64::INFINITY;
    for (at, name) in named {
        canvas.dashes([frame.left, at], frame.right, INK)?;
        let label = at.min(ceiling);
        let name = canvas.fitted(name, 14.0, 220.0)?;
        canvas.text(&name, [frame.right + 8.0, label], 14.0, INK, (HPos::Left, VPos::Center))?;
        ceiling = label - 20.0;
    }
    Ok(())
}

/// Draws the lines and gives the number of points drawn.
fn draw_series<DB: DrawingBackend>(
    chart: &Chart,
    canvas: &Canvas<'_, DB>,
    frame: &Frame,
    x: &Axis,
    y: &Axis,
) -> Result<usize, String> {
    let mut drawn = 0;
    let later = chart.series.len().saturating_sub(1);
    for (order, series) in chart.series.iter().enumerate() {
        // Lines drawn first are wider, so that equal ones show beside those that cover them.
        let width = if chart.marked { 2.6 } else { 1.5 } + 0.7 * ((later - order).min(3) as f64);
        let mut run: Vec<At> = Vec::new();
        let mut runs: Vec<Vec<At>> = Vec::new();
        for point in thinned(&series.points, COLUMNS) {
            match (x.place(point[0]), y.place(point[1])) {
                (Some(px), Some(py)) => run.push([frame.x(px), frame.y(py)]),
                _ => runs.push(std::mem::take(&mut run)),
            }
        }
        runs.push(run);
        for run in runs.iter().filter(|run| !run.is_empty()) {
            drawn += run.len();
            canvas.line(run, colour(series.look), width)?;
            for at in run.iter().filter(|_| chart.marked || run.len() == 1) {
                canvas.marker(*at, series.look)?;
            }
        }
    }
    Ok(drawn)
}

#[cfg(test)]
mod tests {
    use super::super::chart::{AxisPlan, Scale, Series, Ticks};
    use super::*;
    use proptest::prelude::*;

    fn chart(series: Vec<Series>, scale: Scale, marked: bool) -> Chart {
        let axis = |name: &str| AxisPlan { name: name.into(), scale, ticks: Ticks::Round, shows: Vec::new() };
        Chart {
            stem: "x",
            title: "A title of ordinary length".into(),
            subtitle: "what it is of".into(),
            caption: String::new(),
            x: axis("Frame"),
            y: axis("Time, ms"),
            series,
            references: vec![(10.0, "ten".into()), (10.1, "a bit more".into())],
            marked,
        }
    }

    fn series(points: Vec<[f64; 2]>) -> Series {
        Series { name: "an & <engine>".into(), look: 1, points }
    }

    #[test]
    fn drawings_and_pictures_are_sound() {
        let line = series((0..50).map(|i| [f64::from(i), f64::from(i * i)]).collect());
        let chart = chart(vec![line], Scale::Linear, true);
        let text = svg(&chart).unwrap();
        assert!(
            text.starts_with("<svg width=\"1200\" height=\"700\" viewBox=\"0 0 3600 2100\""),
            "{}",
            &text[..90]
        );
        assert!(text.trim_end().ends_with("</svg>") && text.contains("an &amp; &lt;engine&gt;"));
        let png = png(&chart).unwrap();
        assert_eq!(&png[..8], b"\x89PNG\r\n\x1a\n");
        assert_eq!(&png[16..24], [0, 0, 4, 0xb0, 0, 0, 2, 0xbc]);
    }

    #[test]
    fn the_line_is_where_the_data_are() {
        let line = series(vec![[0.0, 0.0], [100.0, 100.0]]);
        let pixels = pixels(&chart(vec![line], Scale::Linear, false)).unwrap();
        assert_eq!(pixels.len(), 1200 * 700 * 3);
        let blue = (0..700 * 1200).filter(|i| pixels[3 * i..3 * i + 3] == [0x00, 0x72, 0xb2]).count();
        assert!((600..6000).contains(&blue), "{blue}");
        assert_eq!(pixels[..3], [255, 255, 255]);
    }

    #[test]
    fn the_file_does_not_grow_with_the_flight() {
        let line = |n: u32| vec![series((0..n).map(|i| [f64::from(i), f64::from(i % 97)]).collect())];
        let long = svg(&chart(line(300_000), Scale::Linear, false)).unwrap();
        assert!(long.len() < 100_000, "{}", long.len());
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(24))]
        #[test]
        fn any_data_are_drawn(
            values in prop::collection::vec(prop_oneof![any::<f64>(), Just(0.0), Just(5.0), 0.0..1e3f64], 0..20),
            log in any::<bool>(), marked in any::<bool>(), title in "\\PC{0,300}", engines in 0usize..30,
        ) {
            let points: Vec<[f64; 2]> = values.iter().enumerate().map(|(i, v)| [i as f64, *v]).collect();
            let all = (0..engines).map(|look| Series { look, name: title.clone(), points: points.clone() }).collect();
            let scale = if log { Scale::Logarithmic } else { Scale::Linear };
            let chart = Chart { title, ..chart(all, scale, marked) };
            let text = svg(&chart).unwrap();
            prop_assert!(!text.contains("NaN"));
        }
    }
}
