//! Description → materials.

use std::path::{Path, PathBuf};

use crate::bsdf::microfacet::Ggx;
use crate::bsdf::{Coat, CoatTable, CoatedDiffuse, MetalTable};
use crate::math::Rgb;
use crate::scene::Span;
use crate::scene::description::{self, Encoding, MaterialKind, Roughness, Value};
use crate::spectrum::{ConductorTable, Spectrum, Uplift};
use crate::texture::image::Channels;
use crate::texture::{Pyramid, Textures};

use super::{Kind, Material, Materials, Metal, Needs, Widths, width};

/// A message about one material.
pub type Message = (Span, String);

impl Materials {
    /// Builds all materials of a scene, with warnings about what will look different from what is described.
    ///
    /// # Errors
    /// Normal maps that cannot be read, all of them.
    pub fn build(
        materials: &[description::Material],
        textures: &Textures,
    ) -> Result<(Self, Vec<Message>), Vec<Message>> {
        let (list, curves, coats, metals, normal_maps) = Default::default();
        let mut builder = Builder {
            textures,
            built: Materials { list, curves, coats, metals, normal_maps },
            curve_keys: Vec::new(),
            normal_map_keys: Vec::new(),
            coat_keys: Vec::new(),
            metal_keys: Vec::new(),
            warnings: Vec::new(),
            errors: Vec::new(),
        };
        for material in materials {
            let built = builder.material(material);
            builder.built.list.push(built);
        }
        if builder.errors.is_empty() { Ok((builder.built, builder.warnings)) } else { Err(builder.errors) }
    }
}

struct Builder<'a> {
    textures: &'a Textures,
    built: Materials,
    /// Which η, k and index above each curve is for.
    curve_keys: Vec<(Spectrum, Spectrum, f32)>,
    /// Which file each normal map is from.
    normal_map_keys: Vec<PathBuf>,
    /// Which index, thickness and width each coat table is for; a width of `None` is textured.
    coat_keys: Vec<(f32, f32, Option<f32>)>,
    /// Which coat and base width each metal table is for.
    metal_keys: Vec<(u32, Option<f32>)>,
    warnings: Vec<Message>,
    errors: Vec<Message>,
}

impl Builder<'_> {
    fn material(&mut self, material: &description::Material) -> Material {
        let kind = self.kind(material);
        let normal_map = material.normal_map.as_deref().and_then(|path| self.normal_map(path, material.span));
        // A displacement that is the same everywhere bends nothing.
        let displacement = material.displacement.and_then(|id| match self.textures.folded_float(&Value::Texture(id)) {
            Value::Texture(id) => Some(id),
            Value::Constant(_) => None,
        });
        let anisotropic = kind.anisotropic();
        let bent = displacement.is_some() || normal_map.is_some();
        let mut needs = Needs { texture_point: kind.textured() || bent, tangents: anisotropic || bent };
        if let Kind::Mix { materials, .. } = &kind {
            for part in materials.map(|id| self.built.list[id.index()].needs) {
                needs.texture_point |= part.texture_point;
                needs.tangents |= part.tangents;
            }
        }
        Material { kind, needs, anisotropic, displacement, normal_map }
    }

    fn kind(&mut self, material: &description::Material) -> Kind {
        match &material.kind {
            MaterialKind::Interface => Kind::Interface,
            MaterialKind::Diffuse { reflectance } => Kind::Diffuse { reflectance: self.rgb(reflectance) },
            MaterialKind::DiffuseTransmission { reflectance, transmittance } => {
                Kind::DiffuseTransmission { reflectance: self.rgb(reflectance), transmittance: self.rgb(transmittance) }
            }
            MaterialKind::Conductor { conductor, roughness } => {
                Kind::Conductor { metal: self.metal(conductor, 1.0), widths: self.widths(roughness) }
            }
            MaterialKind::Dielectric { eta, roughness } => {
                Kind::Dielectric { eta: *eta, widths: self.widths(roughness) }
            }
            MaterialKind::ThinDielectric { eta } => Kind::ThinDielectric { eta: *eta },
            MaterialKind::CoatedDiffuse { reflectance, coat } => {
                let widths = self.widths(&coat.roughness);
                let reflectance = self.rgb(reflectance);
                let coat = self.coat(coat, &widths, material.span);
                let response = match (&reflectance, &widths) {
                    (Value::Constant(albedo), Widths::Constant(ggx)) => Some(self.response(*albedo, *ggx, coat)),
                    _ => None,
                };
                Kind::CoatedDiffuse { reflectance, response, coat, widths }
            }
            MaterialKind::CoatedConductor { conductor, conductor_roughness, coat } => {
                let (widths, base) = (self.widths(&coat.roughness), self.widths(conductor_roughness));
                let metal = self.metal(conductor, coat.eta);
                let coat = self.coat(coat, &widths, material.span);
                let table = self.metal_table(coat, base.constant());
                Kind::CoatedConductor { metal, base, widths, coat, table }
            }
            MaterialKind::Mix { materials, amount } => {
                Kind::Mix { materials: *materials, amount: self.textures.folded_float(amount) }
            }
        }
    }

    /// Index of an image: each is loaded once.
    fn normal_map(&mut self, path: &Path, span: Span) -> Option<u32> {
        if let Some(known) = self.normal_map_keys.iter().position(|known| known == path) {
            return Some(known as u32);
        }
        match Pyramid::load(path, Channels::Rgb, Some(Encoding::Linear)) {
            Ok(image) => {
                self.built.normal_maps.push(image);
                self.normal_map_keys.push(path.to_owned());
                Some(self.normal_map_keys.len() as u32 - 1)
            }
            Err(why) => {
                self.errors.push((span, format!("the normal map cannot be read: {why}")));
                None
            }
        }
    }

    fn rgb(&self, value: &Value<Rgb>) -> Value<Rgb> {
        self.textures.folded_rgb(value)
    }

    fn widths(&self, roughness: &Roughness) -> Widths {
        let (u, v) = (self.textures.folded_float(&roughness.u), self.textures.folded_float(&roughness.v));
        match (&u, &v) {
            (Value::Constant(u), Value::Constant(v)) => {
                Widths::Constant(Ggx::new(glam::Vec2::new(width(*u, roughness.remap), width(*v, roughness.remap))))
            }
            _ => Widths::Textured { u, v, remap: roughness.remap },
        }
    }

    /// `relative`: index of the medium above.
    fn metal(&mut self, conductor: &description::Conductor, relative: f32) -> Metal {
        match conductor {
            description::Conductor::EtaK { eta: Value::Constant(eta), k: Value::Constant(k) } => {
                let known =
                    self.curve_keys.iter().position(|known| (&known.0, &known.1, known.2) == (eta, k, relative));
                let index = known.unwrap_or_else(|| {
                    self.curve_keys.push((eta.clone(), k.clone(), relative));
                    self.built.curves.push(ConductorTable::new(eta, k, relative));
                    self.curve_keys.len() - 1
                });
                Metal::Curve(index as u32)
            }
            description::Conductor::EtaK { eta, k } => {
                let rgb = |value: &Value<Spectrum>| match value {
                    Value::Constant(spectrum) => Value::Constant(spectrum.unbounded_rgb()),
                    Value::Texture(id) => self.textures.folded_rgb(&Value::Texture(*id)),
                };
                Metal::Index { eta: rgb(eta), k: rgb(k), relative }
            }
            description::Conductor::Reflectance(reflectance) => {
                Metal::Reflectance { at_normal: self.rgb(reflectance), relative }
            }
        }
    }

    /// Index of the tables of a coat: coats that are alike share them.
    fn coat(&mut self, coat: &description::Coat, widths: &Widths, span: Span) -> u32 {
        let thickness = match self.textures.folded_float(&coat.thickness) {
            Value::Constant(thickness) => thickness,
            Value::Texture(_) => {
                self.warnings.push((
                    span,
                    format!("a coat's thickness cannot be textured yet; it is {DEFAULT_THICKNESS} everywhere"),
                ));
                DEFAULT_THICKNESS
            }
        };
        if self.textures.folded_rgb(&coat.albedo) != Value::Constant(Rgb::ZERO) {
            self.warnings.push((span, "scattering within a coat is not rendered yet; the coat is drawn clear".into()));
        }
        let alpha = widths.constant();
        let key = (coat.eta, thickness, alpha);
        let index = self.coat_keys.iter().position(|known| *known == key).unwrap_or_else(|| {
            self.coat_keys.push(key);
            self.built.coats.push(CoatTable::new(coat.eta, thickness, alpha));
            self.coat_keys.len() - 1
        });
        index as u32
    }

    /// RGB of the light that a base of `albedo` sends back through a coat: the bounces between them are not linear in the
    /// albedo, so they are summed by wavelength.
    fn response(&self, albedo: Rgb, ggx: Ggx, coat: u32) -> Rgb {
        let coat = Coat::new(ggx, &self.built.coats[coat as usize]);
        let albedo = albedo.clamp(Rgb::ZERO, Rgb::ONE);
        if albedo.max_element() == albedo.min_element() {
            return Rgb::splat(CoatedDiffuse::response(&coat, f64::from(albedo.x)) as f32);
        }
        Uplift::new(albedo).rgb_of(|rho| CoatedDiffuse::response(&coat, rho))
    }

    fn metal_table(&mut self, coat: u32, base_alpha: Option<f32>) -> u32 {
        let key = (coat, base_alpha);
        let index = self.metal_keys.iter().position(|known| *known == key).unwrap_or_else(|| {
            self.metal_keys.push(key);
            self.built.metals.push(MetalTable::new(&self.built.coats[coat as usize], base_alpha));
            self.metal_keys.len() - 1
        });
        index as u32
    }
}

/// **Source**: pbrt-v4's default.
const DEFAULT_THICKNESS: f32 = 0.01;

impl Widths {
    /// The mean width, if it is the same everywhere.
    fn constant(&self) -> Option<f32> {
        match self {
            Self::Constant(ggx) => Some(ggx.mean_alpha()),
            Self::Textured { .. } => None,
        }
    }

    fn anisotropic(&self) -> bool {
        match self {
            Self::Constant(ggx) => ggx.alpha().x != ggx.alpha().y,
            Self::Textured { u, v, .. } => u != v,
        }
    }
}

impl Kind {
    fn textured(&self) -> bool {
        let widths = |widths: &Widths| matches!(widths, Widths::Textured { .. });
        let rgb = |value: &Value<Rgb>| matches!(value, Value::Texture(_));
        let metal = |metal: &Metal| match metal {
            Metal::Curve(_) => false,
            Metal::Index { eta, k, .. } => rgb(eta) || rgb(k),
            Metal::Reflectance { at_normal, .. } => rgb(at_normal),
        };
        match self {
            Self::Interface | Self::ThinDielectric { .. } => false,
            Self::Diffuse { reflectance } => rgb(reflectance),
            Self::DiffuseTransmission { reflectance, transmittance } => rgb(reflectance) || rgb(transmittance),
            Self::Conductor { metal: m, widths: w } => metal(m) || widths(w),
            Self::Dielectric { widths: w, .. } => widths(w),
            Self::CoatedDiffuse { reflectance, widths: w, .. } => rgb(reflectance) || widths(w),
            Self::CoatedConductor { metal: m, base, widths: w, .. } => metal(m) || widths(base) || widths(w),
            Self::Mix { amount, .. } => matches!(amount, Value::Texture(_)),
        }
    }

    fn anisotropic(&self) -> bool {
        match self {
            Self::Conductor { widths, .. } | Self::Dielectric { widths, .. } | Self::CoatedDiffuse { widths, .. } => {
                widths.anisotropic()
            }
            Self::CoatedConductor { base, widths, .. } => base.anisotropic() || widths.anisotropic(),
            _ => false,
        }
    }
}
