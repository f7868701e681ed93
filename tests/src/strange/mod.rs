//! Scenes made of bytes: every directive that is rendered, in any order, with plain numbers and strange ones. The same bytes
//! are the same scene; none is malformed, so that what is tried is not the reader of the text.
//!
//! `tests/fuzz` lets a fuzzer choose the bytes, `tests/tests/extremes/strange.rs` a fixed sequence.

mod directives;
mod verdict;

pub use verdict::{Folder, Outcome, Wrong};

use directives::{CAMERAS, Entity, FILTERS, Kind, LIGHTS, MATERIALS, SHAPES, TEXTURES};

/// Numbers that scenes are full of.
const PLAIN: [&str; 8] = ["1", "0.5", "2", "0.25", "3", "0.1", "1.5", "0.9"];

/// Places and directions.
const PLACES: [&str; 10] = ["0", "1", "-1", "0.5", "-0.5", "2", "-2", "0.25", "3", "-0.75"];

/// Numbers that no parameter expects.
const ODD: [&str; 18] = [
    "0",
    "-0",
    "1e-38",
    "1e-30",
    "1e-12",
    "1e-6",
    "1e-4",
    "1e-3",
    "0.9999999",
    "1.0000001",
    "1000",
    "1e4",
    "1e6",
    "1e12",
    "1e30",
    "3e38",
    "-1e-20",
    "180",
];

/// Levels of light; the largest leaves room for what brings it nearer.
const LEVELS: [&str; 8] = ["1", "10", "0.1", "0", "1e-12", "1e-30", "1e6", "1e12"];

/// Colours.
const COLOURS: [&str; 10] = [
    "0.5 0.5 0.5",
    "1 1 1",
    "0.9 0.2 0.1",
    "0 0 0",
    "1 0 0",
    "2 2 2",
    "0 0 1e-30",
    "0.999999 1 1",
    "1e-6 1e-6 1",
    "0.1 0.5 1",
];

/// Choices that bytes make; where they end, the first of all.
struct Choices<'a>(&'a [u8]);

impl Choices<'_> {
    fn below(&mut self, end: usize) -> usize {
        let Some((&first, rest)) = self.0.split_first() else { return 0 };
        self.0 = rest;
        usize::from(first) % end
    }

    fn of<'t>(&mut self, all: &[&'t str]) -> &'t str {
        all[self.below(all.len())]
    }

    /// One in `n`.
    fn rarely(&mut self, n: usize) -> bool {
        self.below(n) == n - 1
    }

    fn number(&mut self) -> &'static str {
        if self.rarely(8) { self.of(&ODD) } else { self.of(&PLAIN) }
    }

    /// Coordinates, all plain or one in four odd.
    fn place(&mut self, count: usize) -> String {
        let odd = self.rarely(6);
        let all = (0..count).map(|_| if odd && self.rarely(4) { self.of(&ODD) } else { self.of(&PLACES) });
        all.collect::<Vec<_>>().join(" ")
    }
}

/// The scene of the bytes.
pub fn scene(bytes: &[u8]) -> String {
    let mut choices = Choices(bytes);
    let mut text = head(&mut choices);
    text += "WorldBegin\n";
    let mut open = 0;
    // Most scenes want to be lit and seen.
    if !choices.rarely(4) {
        text += "LightSource \"infinite\"\n";
    }
    if !choices.rarely(4) {
        text += "Translate 0 0 4\n";
    }
    for _ in 0..24 {
        if choices.0.is_empty() {
            break;
        }
        text += &directive(&mut choices, &mut open);
    }
    text + &"AttributeEnd\n".repeat(open)
}

fn head(choices: &mut Choices) -> String {
    let size = choices.of(&["4", "1", "7", "9"]);
    let depth = choices.of(&["5", "0", "1", "2", "30"]);
    let mut text = format!("Film \"rgb\" \"integer xresolution\" {size} \"integer yresolution\" 4\n");
    text += &format!("Integrator \"path\" \"integer maxdepth\" {depth}\n");
    if choices.rarely(4) {
        text += &entity("PixelFilter", &FILTERS[choices.below(FILTERS.len())], choices);
    }
    if choices.rarely(4) {
        text += &transform(choices);
    }
    if choices.rarely(2) { text + &entity("Camera", &CAMERAS[choices.below(CAMERAS.len())], choices) } else { text }
}

fn directive(choices: &mut Choices, open: &mut usize) -> String {
    let material = |choices: &mut Choices| entity("Material", &MATERIALS[choices.below(MATERIALS.len())], choices);
    let shape = |choices: &mut Choices| {
        if choices.rarely(3) { mesh(choices) } else { entity("Shape", &SHAPES[choices.below(SHAPES.len())], choices) }
    };
    match choices.below(16) {
        0..4 => shape(choices),
        4..7 => material(choices),
        7 => format!("AreaLightSource \"diffuse\" {}\n", Kind::Level.value("L", choices)),
        8 => entity("LightSource", &LIGHTS[choices.below(LIGHTS.len())], choices),
        9..11 => transform(choices),
        11 => texture(choices),
        12 => {
            *open += 1;
            "AttributeBegin\n".into()
        }
        13 if *open > 0 => {
            *open -= 1;
            "AttributeEnd\n".into()
        }
        13 => "ReverseOrientation\n".into(),
        14 => {
            let inside = (material(choices), transform(choices), shape(choices));
            let name = format!("o{}", choices.0.len());
            let outside = transform(choices);
            format!(
                "ObjectBegin \"{name}\"\n{}{}{}ObjectEnd\nObjectInstance \"{name}\"\n{outside}ObjectInstance \"{name}\"\n",
                inside.0, inside.1, inside.2
            )
        }
        _ => {
            let (a, b, name) = (choices.0.len(), choices.0.len() + 1000, choices.0.len() + 2000);
            let part = |choices: &mut Choices, name: usize| {
                let material = &MATERIALS[choices.below(MATERIALS.len())];
                let body = entity("MakeNamedMaterial", material, choices);
                // The entity's own name becomes its type.
                let (head, rest) = body.split_once(&format!("\"{}\"", material.name)).unwrap_or((&body, ""));
                format!("{head}\"m{name}\" \"string type\" \"{}\"{rest}", material.name)
            };
            let parts = part(choices, a) + &part(choices, b);
            let amount = Kind::Number.value("amount", choices);
            format!(
                "{parts}MakeNamedMaterial \"m{name}\" \"string type\" \"mix\" \"string materials\" [ \"m{a}\" \"m{b}\" ] \
                 {amount}\nNamedMaterial \"m{name}\"\n"
            )
        }
    }
}

/// A directive, with those of the entity's parameters that the bytes choose.
fn entity(directive: &str, entity: &Entity, choices: &mut Choices) -> String {
    let mut text = format!("{directive} \"{}\"", entity.name);
    for (name, kind) in entity.parameters {
        // A curve without points is none.
        if matches!(kind, Kind::Points(_)) || !choices.rarely(2) {
            text += " ";
            text += &kind.value(name, choices);
        }
    }
    text + "\n"
}

fn transform(choices: &mut Choices) -> String {
    match choices.below(7) {
        0 => format!("Translate {}\n", choices.place(3)),
        1 => format!("Scale {} {} {}\n", choices.number(), choices.number(), choices.number()),
        2 => format!("Scale {0} {0} {0}\n", choices.number()),
        3 => format!("Rotate {} {}\n", choices.of(&["30", "90", "180", "1e-6", "720000.5"]), choices.place(3)),
        4 => "Identity\n".into(),
        5 => format!("LookAt {} {} 0 1 0\n", choices.place(3), choices.place(3)),
        _ => {
            let linear: Vec<String> = (0..3).map(|_| choices.place(3)).collect();
            format!("ConcatTransform [ {} 0 {} 0 {} 0 {} 1 ]\n", linear[0], linear[1], linear[2], choices.place(3))
        }
    }
}

/// A material that looks at a texture; two textures of which it may be made.
fn texture(choices: &mut Choices) -> String {
    let name = choices.0.len();
    let class = &TEXTURES[choices.below(TEXTURES.len())];
    let kind = match class.name {
        "fbm" | "wrinkled" | "windy" => "float",
        "marble" => "spectrum",
        _ => choices.of(&["float", "spectrum"]),
    };
    // Which of the types a class mixes follows from its own.
    let mut body = entity("", class, choices).replace("VALUE", if kind == "float" { "float" } else { "rgb" });
    if kind == "spectrum" {
        body = body.replace("]", "0.5 0.25 ]");
    }
    let image = if class.name == "imagemap" {
        format!(" \"string filename\" \"{}\"", choices.of(&verdict::IMAGES))
    } else {
        String::new()
    };
    let body = body.trim_end();
    let used = match kind {
        "float" => choices.of(&[
            "Material \"conductor\" \"texture roughness\"",
            "Material \"diffuse\" \"texture displacement\"",
            "Material \"coateddiffuse\" \"texture thickness\"",
            "Shape \"sphere\" \"texture alpha\"",
        ]),
        _ => choices.of(&[
            "Material \"diffuse\" \"texture reflectance\"",
            "Material \"conductor\" \"texture reflectance\"",
            "Material \"coateddiffuse\" \"texture albedo\"",
            "Material \"conductor\" \"texture eta\"",
        ]),
    };
    format!("Texture \"t{name}\" \"{kind}\"{body}{image}\n{used} \"t{name}\"\n")
}

/// A mesh of any corners.
fn mesh(choices: &mut Choices) -> String {
    let (name, group) = if choices.rarely(2) { ("trianglemesh", 3) } else { ("bilinearmesh", 4) };
    let vertices = group + choices.below(3);
    let faces = 1 + choices.below(3);
    let indices: Vec<String> = (0..group * faces).map(|_| choices.below(vertices).to_string()).collect();
    let mut text = format!(
        "Shape \"{name}\" \"point3 P\" [ {} ] \"integer indices\" [ {} ]",
        choices.place(3 * vertices),
        indices.join(" ")
    );
    if choices.rarely(3) {
        text += &format!(" \"normal N\" [ {} ]", choices.place(3 * vertices));
    }
    if choices.rarely(3) {
        text += &format!(" \"point2 uv\" [ {} ]", choices.place(2 * vertices));
    }
    if group == 3 && choices.rarely(4) {
        text += &format!(" \"vector3 S\" [ {} ]", choices.place(3 * vertices));
    }
    if choices.rarely(4) {
        text += &format!(" \"float alpha\" {}", choices.number());
    }
    text + "\n"
}
