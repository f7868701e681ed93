//! The grammar of directives: from tokens to one [`Directive`] at a time, with no knowledge of what they do.

use super::lexer::{Kind, Token};
use super::param::{Param, read_params};
use super::report::{did_you_mean, shown};
use super::source::{Cursor, Fault};
use crate::scene::Span;
use crate::spectrum::RgbSpace;

/// Every directive, and thus every place where reading can go on after an error.
pub(super) const DIRECTIVES: [&str; 41] = [
    "Accelerator",
    "ActiveTransform",
    "AreaLightSource",
    "Attribute",
    "AttributeBegin",
    "AttributeEnd",
    "Camera",
    "ColorSpace",
    "ConcatTransform",
    "CoordSysTransform",
    "CoordinateSystem",
    "Film",
    "Identity",
    "Import",
    "Include",
    "Integrator",
    "LightSource",
    "LookAt",
    "MakeNamedMaterial",
    "MakeNamedMedium",
    "Material",
    "MediumInterface",
    "NamedMaterial",
    "ObjectBegin",
    "ObjectEnd",
    "ObjectInstance",
    "Option",
    "PixelFilter",
    "ReverseOrientation",
    "Rotate",
    "Sampler",
    "Scale",
    "Shape",
    "Texture",
    "Transform",
    "TransformBegin",
    "TransformEnd",
    "TransformTimes",
    "Translate",
    "WorldBegin",
    "WorldEnd",
];

/// Directives of the form `Word "name" parameters`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Entity {
    Accelerator,
    AreaLight,
    Attribute,
    Camera,
    Film,
    Integrator,
    Light,
    Material,
    NamedMaterial,
    NamedMedium,
    PixelFilter,
    Sampler,
    Shape,
}

/// One directive with its arguments.
#[derive(Debug)]
pub(super) enum Directive {
    Identity,
    Translate([f64; 3]),
    Scale([f64; 3]),
    Rotate([f64; 4]),
    LookAt([f64; 9]),
    Transform([f64; 16]),
    ConcatTransform([f64; 16]),
    TransformTimes,
    /// Which of start and end the transform directives act on.
    ActiveTransform([bool; 2]),
    CoordinateSystem(String),
    CoordSysTransform(String),
    ColorSpace(String),
    ReverseOrientation,
    AttributeBegin,
    AttributeEnd,
    TransformBegin,
    TransformEnd,
    WorldBegin,
    WorldEnd,
    ObjectBegin(String),
    ObjectEnd,
    ObjectInstance(String),
    NamedMaterial(String),
    /// Inside and outside.
    MediumInterface(String, String),
    Include(String),
    Import(String),
    Option {
        name: String,
        value: String,
    },
    Texture {
        name: String,
        values: String,
        class: String,
        params: Vec<Param>,
    },
    Entity(Entity, String, Vec<Param>),
}

/// Reads the directive at the cursor. `None` at the end of the file.
///
/// The span covers the directive's word, and its name if it has one.
pub(super) fn read_directive(
    cursor: &mut Cursor<'_, '_>,
    color_space: RgbSpace,
) -> Option<Result<(Directive, Span), Fault>> {
    let token = cursor.peek()?;
    if !cursor.is_directive(token) {
        return Some(Err(unknown(cursor, token)));
    }
    cursor.advance();
    Some(arguments(cursor, token, color_space))
}

fn unknown(cursor: &mut Cursor<'_, '_>, token: Token) -> Fault {
    let word = cursor.content(token);
    cursor.advance();
    let span = cursor.span(token);
    let text = match token.kind {
        Kind::Word => {
            let hint = did_you_mean(&word, DIRECTIVES.iter().copied());
            format!("{} is not a directive{hint}", shown(&word))
        }
        _ => format!("expected a directive, found {}", shown(&String::from_utf8_lossy(cursor.bytes(token)))),
    };
    cursor.fault(span, text)
}

fn arguments(cursor: &mut Cursor<'_, '_>, word: Token, space: RgbSpace) -> Result<(Directive, Span), Fault> {
    let mut span = cursor.span(word);
    let mut entity = |cursor: &mut Cursor<'_, '_>, entity| {
        let (name, name_span) = cursor.string("a name")?;
        span.end = name_span.end;
        Ok(Directive::Entity(entity, name, read_params(cursor, space)))
    };
    let directive = match cursor.bytes(word) {
        b"Accelerator" => entity(cursor, Entity::Accelerator)?,
        b"AreaLightSource" => entity(cursor, Entity::AreaLight)?,
        b"Attribute" => entity(cursor, Entity::Attribute)?,
        b"Camera" => entity(cursor, Entity::Camera)?,
        b"Film" => entity(cursor, Entity::Film)?,
        b"Integrator" => entity(cursor, Entity::Integrator)?,
        b"LightSource" => entity(cursor, Entity::Light)?,
        b"Material" => entity(cursor, Entity::Material)?,
        b"MakeNamedMaterial" => entity(cursor, Entity::NamedMaterial)?,
        b"MakeNamedMedium" => entity(cursor, Entity::NamedMedium)?,
        b"PixelFilter" => entity(cursor, Entity::PixelFilter)?,
        b"Sampler" => entity(cursor, Entity::Sampler)?,
        b"Shape" => entity(cursor, Entity::Shape)?,
        b"Identity" => Directive::Identity,
        b"Translate" => Directive::Translate(cursor.numbers()?),
        b"Scale" => Directive::Scale(cursor.numbers()?),
        b"Rotate" => Directive::Rotate(cursor.numbers()?),
        b"LookAt" => Directive::LookAt(cursor.numbers()?),
        b"Transform" => Directive::Transform(cursor.numbers()?),
        b"ConcatTransform" => Directive::ConcatTransform(cursor.numbers()?),
        b"TransformTimes" => {
            cursor.numbers::<2>()?;
            Directive::TransformTimes
        }
        b"ActiveTransform" => Directive::ActiveTransform(active(cursor)?),
        b"CoordinateSystem" => Directive::CoordinateSystem(cursor.string("a name")?.0),
        b"CoordSysTransform" => Directive::CoordSysTransform(cursor.string("a name")?.0),
        b"ColorSpace" => Directive::ColorSpace(cursor.string("a name")?.0),
        b"ReverseOrientation" => Directive::ReverseOrientation,
        b"AttributeBegin" => Directive::AttributeBegin,
        b"AttributeEnd" => Directive::AttributeEnd,
        b"TransformBegin" => Directive::TransformBegin,
        b"TransformEnd" => Directive::TransformEnd,
        b"WorldBegin" => Directive::WorldBegin,
        b"WorldEnd" => Directive::WorldEnd,
        b"ObjectBegin" => Directive::ObjectBegin(cursor.string("a name")?.0),
        b"ObjectEnd" => Directive::ObjectEnd,
        b"ObjectInstance" => {
            let (name, name_span) = cursor.string("a name")?;
            span.end = name_span.end;
            Directive::ObjectInstance(name)
        }
        b"NamedMaterial" => {
            let (name, name_span) = cursor.string("a name")?;
            span.end = name_span.end;
            Directive::NamedMaterial(name)
        }
        b"MediumInterface" => {
            let (inside, _) = cursor.string("a name")?;
            let second = cursor.peek().is_some_and(|token| token.kind == Kind::Quoted);
            let outside = if second { cursor.string("a name")?.0 } else { inside.clone() };
            Directive::MediumInterface(inside, outside)
        }
        b"Include" => {
            let (path, path_span) = cursor.string("a file's name")?;
            span.end = path_span.end;
            Directive::Include(path)
        }
        b"Import" => {
            let (path, path_span) = cursor.string("a file's name")?;
            span.end = path_span.end;
            Directive::Import(path)
        }
        b"Option" => option(cursor)?,
        b"Texture" => {
            let (name, name_span) = cursor.string("a name")?;
            span.end = name_span.end;
            let (values, _) = cursor.string("\"float\" or \"spectrum\"")?;
            let (class, class_span) = cursor.string("a class of texture")?;
            span.end = class_span.end;
            Directive::Texture { name, values, class, params: read_params(cursor, space) }
        }
        // `is_directive` lets nothing else through.
        other => unreachable!("{}", String::from_utf8_lossy(other)),
    };
    Ok((directive, span))
}

fn active(cursor: &mut Cursor<'_, '_>) -> Result<[bool; 2], Fault> {
    let token = cursor.peek();
    let active = match token.map(|token| cursor.bytes(token)) {
        Some(b"All") => [true, true],
        Some(b"StartTime") => [true, false],
        Some(b"EndTime") => [false, true],
        _ => return Err(cursor.unexpected(token, "All, StartTime or EndTime")),
    };
    cursor.advance();
    Ok(active)
}

fn option(cursor: &mut Cursor<'_, '_>) -> Result<Directive, Fault> {
    let (name, _) = cursor.string("an option's name")?;
    let open = cursor.peek().is_some_and(|token| token.kind == Kind::Open);
    if open {
        cursor.advance();
    }
    let value = match cursor.peek() {
        Some(token) if matches!(token.kind, Kind::Word | Kind::Quoted) && !cursor.is_directive(token) => {
            cursor.advance();
            cursor.content(token).into_owned()
        }
        found => return Err(cursor.unexpected(found, "the option's value")),
    };
    if open {
        match cursor.peek() {
            Some(token) if token.kind == Kind::Close => cursor.advance(),
            found => return Err(cursor.unexpected(found, "a closing bracket")),
        }
    }
    Ok(Directive::Option { name, value })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::pbrt::lexer::Lexer;
    use crate::scene::pbrt::report::Report;

    /// The directives of a text and how many errors there were.
    fn read(text: &str) -> (Vec<Directive>, bool) {
        let mut report = Report::default();
        let mut cursor = Cursor::new(Lexer::new(text.as_bytes()), 0, &mut report);
        let mut all = Vec::new();
        while let Some(directive) = read_directive(&mut cursor, RgbSpace::Srgb) {
            match directive {
                Ok((directive, _)) => all.push(directive),
                Err(_) => cursor.recover(),
            }
        }
        (all, report.failed())
    }

    #[test]
    fn every_directive_of_the_list_is_read() {
        for name in DIRECTIVES {
            // No arguments fit all, but no directive may be taken for an unknown one.
            let mut report = Report::default();
            let mut cursor = Cursor::new(Lexer::new(name.as_bytes()), 0, &mut report);
            let token = cursor.peek().unwrap();
            assert!(cursor.is_directive(token));
            let _ = read_directive(&mut cursor, RgbSpace::Srgb);
        }
    }

    #[test]
    fn brackets_are_optional_around_numbers() {
        for text in ["Translate 1 2 3", "Translate [ 1 2 3 ]"] {
            let (all, failed) = read(text);
            assert!(!failed && matches!(all[..], [Directive::Translate([1.0, 2.0, 3.0])]), "{text}");
        }
        assert!(read("Translate [1 2 3").1);
        assert!(read("Translate 1 2 nan").1);
    }

    #[test]
    fn reading_goes_on_at_the_next_directive() {
        let (all, failed) = read("Translate 1 x Shap \"sphere\" 3 ] Identity Camera Scale 1 1 1 \"left\" Identity");
        assert!(failed);
        assert!(matches!(all[..], [Directive::Identity, Directive::Scale(_), Directive::Identity]), "{all:?}");
    }

    #[test]
    fn a_medium_interface_may_name_one_medium() {
        let (all, _) = read("MediumInterface \"a\" MediumInterface \"a\" \"\"");
        let [Directive::MediumInterface(_, both), Directive::MediumInterface(_, none)] = &all[..] else { panic!() };
        assert_eq!((both.as_str(), none.as_str()), ("a", ""));
    }

    #[test]
    fn options_take_bare_and_quoted_values() {
        let (all, failed) = read("Option \"seed\" 7 Option \"string msereferenceimage\" [ \"a.exr\" ]");
        assert!(!failed);
        assert!(matches!(&all[0], Directive::Option { value, .. } if value == "7"));
        assert!(matches!(&all[1], Directive::Option { value, .. } if value == "a.exr"));
    }
}
