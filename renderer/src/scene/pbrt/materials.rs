//! Materials: `Material "type"` and `MakeNamedMaterial "name" "string type" "type"`.

use std::collections::BTreeMap;

use super::context::Context;
use super::params::Params;
use super::report::{did_you_mean, shown};
use super::spectra::Usage;
use crate::math::Rgb;
use crate::scene::Span;
use crate::scene::description::{Coat, Conductor, Material, MaterialId, MaterialKind, Roughness, TextureKind, Value};
use crate::spectrum::{self, Spectrum};

/// A material as read.
#[derive(Debug)]
pub(super) struct MaterialEntity {
    /// For `MakeNamedMaterial`.
    pub(super) name: Option<String>,
    pub(super) params: Params,
}

#[derive(Debug)]
enum Slot {
    Waiting(Box<MaterialEntity>),
    Building,
    Built(Option<MaterialId>),
}

/// The materials of a scene on their way from entities to descriptions. Slot 0 is the default material.
#[derive(Debug)]
pub(super) struct MaterialTable {
    names: BTreeMap<String, usize>,
    slots: Vec<Slot>,
    built: Vec<Material>,
    depth: usize,
}

impl MaterialTable {
    pub(super) fn new() -> Self {
        let params = Params::none("material", "diffuse", Span::default());
        let default = MaterialEntity { name: None, params };
        let slots = vec![Slot::Waiting(Box::new(default))];
        Self { names: BTreeMap::new(), slots, built: Vec::new(), depth: 0 }
    }

    /// Adds a material and returns its slot; `None` if its name is taken.
    pub(super) fn add(&mut self, entity: MaterialEntity) -> Option<usize> {
        let slot = self.slots.len();
        if let Some(name) = &entity.name {
            if self.names.contains_key(name) {
                return None;
            }
            self.names.insert(name.clone(), slot);
        }
        self.slots.push(Slot::Waiting(Box::new(entity)));
        Some(slot)
    }

    /// Builds all materials, each after those that it uses, the default one first.
    pub(super) fn build_all(&mut self, cx: &mut Context) {
        for slot in 0..self.slots.len() {
            self.build_slot(cx, slot, Span::default());
        }
    }

    /// The material of a slot. `None` after an error.
    pub(super) fn built(&self, slot: usize) -> Option<MaterialId> {
        match self.slots.get(slot) {
            Some(&Slot::Built(id)) => id,
            _ => None,
        }
    }

    /// The slot of a named material; an error if there is none.
    pub(super) fn find(&self, cx: &mut Context, name: &str, span: Span) -> Option<usize> {
        let slot = self.names.get(name).copied();
        if slot.is_none() {
            let hint = did_you_mean(name, self.names.keys().map(String::as_str));
            cx.report.error(span, format!("there is no material named \"{}\"{hint}", shown(name)));
        }
        slot
    }

    /// The materials that were built.
    pub(super) fn into_built(self) -> Vec<Material> {
        self.built
    }

    fn build_slot(&mut self, cx: &mut Context, slot: usize, span: Span) -> Option<MaterialId> {
        // Only names used before their definition nest, so real scenes stay far below this.
        const DEEPEST: usize = 100;
        let mut entity = match std::mem::replace(&mut self.slots[slot], Slot::Building) {
            Slot::Built(id) => {
                self.slots[slot] = Slot::Built(id);
                return id;
            }
            Slot::Building => {
                cx.report.error(span, "this material is a mix of itself");
                return None;
            }
            Slot::Waiting(entity) => *entity,
        };
        if self.depth == DEEPEST {
            self.slots[slot] = Slot::Waiting(Box::new(entity));
            cx.report.error(span, format!("more than {DEEPEST} materials each used before the next is defined"));
            return None;
        }
        self.depth += 1;
        let params = &mut entity.params;
        let built = self.kind(cx, params, entity.name.is_some()).map(|kind| Material {
            kind,
            name: entity.name,
            displacement: params.only_float_texture(cx, "displacement"),
            normal_map: params.path(cx, "normalmap"),
            span: params.span,
        });
        params.finish(cx);
        self.depth -= 1;
        let id = built.map(|material| {
            self.built.push(material);
            MaterialId(self.built.len() as u32 - 1)
        });
        self.slots[slot] = Slot::Built(id);
        id
    }

    fn kind(&mut self, cx: &mut Context, params: &mut Params, named: bool) -> Option<MaterialKind> {
        if named {
            match params.string(cx, "type") {
                Some(name) => params.name = name,
                None => {
                    if !params.has("type") {
                        cx.report.error(params.span, "a named material needs \"string type\"");
                    }
                    params.ignore_all();
                    return None;
                }
            }
        }
        let name = params.name.clone();
        Some(match name.as_str() {
            "" | "none" => {
                let text = format!("material \"{name}\" is an older name of \"interface\"");
                cx.report.warning("older interface", params.span, text);
                MaterialKind::Interface
            }
            "interface" => MaterialKind::Interface,
            "diffuse" => MaterialKind::Diffuse { reflectance: albedo(cx, params, "reflectance", 0.5) },
            "coateddiffuse" => MaterialKind::CoatedDiffuse {
                reflectance: albedo(cx, params, "reflectance", 0.5),
                coat: coat(cx, params, "eta", ROUGHNESS),
            },
            "coatedconductor" => MaterialKind::CoatedConductor {
                conductor: conductor(cx, params, ["conductor.eta", "conductor.k", "reflectance"]),
                conductor_roughness: roughness(cx, params, CONDUCTOR_ROUGHNESS),
                coat: coat(cx, params, "interface.eta", INTERFACE_ROUGHNESS),
            },
            "conductor" => MaterialKind::Conductor {
                conductor: conductor(cx, params, ["eta", "k", "reflectance"]),
                roughness: roughness(cx, params, ROUGHNESS),
            },
            "dielectric" => MaterialKind::Dielectric {
                eta: params.eta(cx, "eta", 1.5),
                roughness: roughness(cx, params, ROUGHNESS),
            },
            "thindielectric" => MaterialKind::ThinDielectric { eta: params.eta(cx, "eta", 1.5) },
            "diffusetransmission" => diffuse_transmission(cx, params),
            "mix" => self.mix(cx, params)?,
            "hair" => hair(cx, params),
            "measured" => measured(cx, params),
            "subsurface" => subsurface(cx, params),
            _ => {
                cx.unknown_type("material", &name, params.span, &TYPES);
                params.ignore_all();
                return None;
            }
        })
    }

    fn mix(&mut self, cx: &mut Context, params: &mut Params) -> Option<MaterialKind> {
        let amount = params.float_texture(cx, "amount", 0.5);
        let names = params.strings(cx, "materials").unwrap_or_default();
        let span = params.span_of("materials");
        let [first, second] = names.as_slice() else {
            let text = format!("a mix takes two \"string materials\", not {}", names.len());
            cx.report.error(span, text);
            return None;
        };
        let mut resolve = |name: &str| {
            let slot = self.find(cx, name, span)?;
            self.build_slot(cx, slot, span)
        };
        let (first, second) = (resolve(first), resolve(second));
        Some(MaterialKind::Mix { materials: [first?, second?], amount })
    }
}

const TYPES: [&str; 12] = [
    "interface",
    "diffuse",
    "coateddiffuse",
    "coatedconductor",
    "conductor",
    "dielectric",
    "thindielectric",
    "diffusetransmission",
    "mix",
    "hair",
    "measured",
    "subsurface",
];

/// Names of the roughness along u, along v, and along both.
type RoughnessNames = [&'static str; 3];
const ROUGHNESS: RoughnessNames = ["uroughness", "vroughness", "roughness"];
const INTERFACE_ROUGHNESS: RoughnessNames = ["interface.uroughness", "interface.vroughness", "interface.roughness"];
const CONDUCTOR_ROUGHNESS: RoughnessNames = ["conductor.uroughness", "conductor.vroughness", "conductor.roughness"];

fn albedo(cx: &mut Context, params: &mut Params, name: &'static str, default: f32) -> Value<Rgb> {
    params.rgb_texture(cx, name, Usage::Albedo, default)
}

fn roughness(cx: &mut Context, params: &mut Params, [u, v, both]: RoughnessNames) -> Roughness {
    let both = params.float_texture(cx, both, 0.0);
    Roughness {
        u: params.opt_float_texture(cx, u).unwrap_or_else(|| both.clone()),
        v: params.opt_float_texture(cx, v).unwrap_or(both),
        remap: params.bool(cx, "remaproughness", true),
    }
}

fn coat(cx: &mut Context, params: &mut Params, eta: &'static str, names: RoughnessNames) -> Coat {
    // Bounds of the random walk between the interfaces in pbrt; ours is not a random walk of samples.
    params.ignore(&["maxdepth", "nsamples"]);
    Coat {
        roughness: roughness(cx, params, names),
        thickness: params.float_texture(cx, "thickness", 0.01),
        eta: params.eta(cx, eta, 1.5),
        g: params.float_texture(cx, "g", 0.0),
        albedo: albedo(cx, params, "albedo", 0.0),
    }
}

fn conductor(cx: &mut Context, params: &mut Params, [eta, k, reflectance]: [&'static str; 3]) -> Conductor {
    let both = params.has(reflectance) && (params.has(eta) || params.has(k));
    if both {
        let text = format!("\"{reflectance}\" excludes \"{eta}\" and \"{k}\": give either");
        cx.report.error(params.span_of(reflectance), text);
    }
    let given_eta = params.opt_spectrum_texture(cx, eta);
    let given_k = params.opt_spectrum_texture(cx, k);
    if let Some(reflectance) = params.opt_rgb_texture(cx, reflectance, Usage::Albedo) {
        return Conductor::Reflectance(reflectance);
    }
    Conductor::EtaK {
        eta: given_eta.unwrap_or_else(|| copper("metal-Cu-eta")),
        k: given_k.unwrap_or_else(|| copper("metal-Cu-k")),
    }
}

/// The default metal.
fn copper(name: &str) -> Value<Spectrum> {
    Value::Constant(spectrum::named(name).expect("the tables of the renderer hold copper"))
}

fn diffuse_transmission(cx: &mut Context, params: &mut Params) -> MaterialKind {
    // pbrt reads it of all materials and here has no roughness to apply it to.
    params.ignore(&["remaproughness"]);
    let reflectance = albedo(cx, params, "reflectance", 0.25);
    let transmittance = albedo(cx, params, "transmittance", 0.25);
    let scale = params.float_where(cx, "scale", 1.0, "at least 0", |scale| scale >= 0.0);
    let span = params.span;
    let mut scaled = |value: Value<Rgb>| match value {
        Value::Constant(rgb) => Value::Constant(rgb * scale),
        Value::Texture(_) if scale == 1.0 => value,
        Value::Texture(_) => {
            let kind = TextureKind::Scale { tex: value, scale: Value::Constant(scale) };
            Value::Texture(super::textures::add_built(cx, "scale of a diffusetransmission", kind, span))
        }
    };
    MaterialKind::DiffuseTransmission { reflectance: scaled(reflectance), transmittance: scaled(transmittance) }
}

fn hair(cx: &mut Context, params: &mut Params) -> MaterialKind {
    params.ignore(&["sigma_a", "eumelanin", "pheomelanin", "eta", "beta_m", "beta_n", "alpha"]);
    let text = "hair is not rendered: a diffuse surface of its colour is drawn in its place";
    cx.report.warning("hair", params.span, text);
    // Brown, pbrt's default pigment.
    let default = Value::Constant(Rgb::new(0.15, 0.09, 0.05));
    let older = params.opt_rgb_texture(cx, "color", Usage::Albedo);
    MaterialKind::Diffuse {
        reflectance: params.opt_rgb_texture(cx, "reflectance", Usage::Albedo).or(older).unwrap_or(default),
    }
}

fn measured(cx: &mut Context, params: &mut Params) -> MaterialKind {
    params.ignore(&["filename"]);
    let text = "measured materials are not rendered: a diffuse surface of reflectance 0.5 is drawn in their place";
    cx.report.warning("measured material", params.span, text);
    MaterialKind::Diffuse { reflectance: Value::Constant(Rgb::splat(0.5)) }
}

fn subsurface(cx: &mut Context, params: &mut Params) -> MaterialKind {
    params.ignore(&["name", "mfp", "scale", "g"]);
    let text = "subsurface scattering is not rendered: a coated diffuse surface is drawn in its place";
    cx.report.warning("subsurface", params.span, text);
    let reflectance = params.opt_rgb_texture(cx, "reflectance", Usage::Albedo);
    let absorbed = params.opt_rgb_texture(cx, "sigma_a", Usage::Unbounded);
    let scattered = params.opt_rgb_texture(cx, "sigma_s", Usage::Unbounded);
    let reflectance = reflectance.unwrap_or_else(|| match (absorbed, scattered) {
        (Some(Value::Constant(a)), Some(Value::Constant(s))) => Value::Constant(semi_infinite_albedo(a, s)),
        // pbrt's default coefficients.
        (None, None) => {
            Value::Constant(semi_infinite_albedo(Rgb::new(0.0011, 0.0024, 0.014), Rgb::new(2.55, 3.21, 3.77)))
        }
        _ => Value::Constant(Rgb::splat(0.5)),
    });
    let coat = Coat {
        roughness: roughness(cx, params, ROUGHNESS),
        thickness: Value::Constant(0.0),
        eta: params.eta(cx, "eta", 1.33),
        g: Value::Constant(0.0),
        albedo: Value::Constant(Rgb::ZERO),
    };
    MaterialKind::CoatedDiffuse { reflectance, coat }
}

/// Diffuse reflectance of a half space that absorbs `a` and scatters `s` per unit length, isotropically and with
/// matched boundaries.
///
/// **Source**: van de Hulst's similarity fit, (1 − q)(1 − 0.139 q) / (1 + 1.17 q) with q = √(1 − single-scattering
/// albedo), \[Hulst80\].
fn semi_infinite_albedo(a: Rgb, s: Rgb) -> Rgb {
    let single = s / (a + s).max(Rgb::splat(f32::MIN_POSITIVE));
    let q = (Rgb::ONE - single).clamp(Rgb::ZERO, Rgb::ONE).map(f32::sqrt);
    (Rgb::ONE - q) * (Rgb::ONE - 0.139 * q) / (Rgb::ONE + 1.17 * q)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_half_space_that_only_scatters_is_white_and_one_that_only_absorbs_black() {
        assert_eq!(semi_infinite_albedo(Rgb::ZERO, Rgb::ONE), Rgb::ONE);
        assert_eq!(semi_infinite_albedo(Rgb::ONE, Rgb::ZERO), Rgb::ZERO);
    }
}
