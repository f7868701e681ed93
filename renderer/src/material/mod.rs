//! What a surface is made of, and what that means at one hit.
//!
//! A description's material becomes a [`Material`] at build: textures that turned out constant are folded in, curves of
//! metals and tables of coats are made once and shared by index. At a hit, [`Materials::shade`] looks up what is textured
//! and returns a frame and a [`Bsdf`] on the stack.

mod build;
mod perturb;

use glam::{Vec2, Vec3};

use crate::bsdf::fresnel::ConductorFresnel;
use crate::bsdf::microfacet::Ggx;
use crate::bsdf::{
    Bsdf, Coat, CoatTable, CoatedConductor, CoatedDiffuse, Conductor, Dielectric, Diffuse, DiffuseTransmission,
    MetalTable, ThinDielectric,
};
use crate::math::{Frame, Rgb};
use crate::sampling::mix64;
use crate::scene::description::{MaterialId, TextureId, Value};
use crate::spectrum::ConductorTable;
use crate::texture::{Pyramid, TexturePoint, Textures};

/// All materials of a scene.
#[derive(Clone, Debug)]
pub struct Materials {
    list: Vec<Material>,
    curves: Vec<ConductorTable>,
    coats: Vec<CoatTable>,
    metals: Vec<MetalTable>,
    normal_maps: Vec<Pyramid>,
}

/// What of a hit a material looks at, so that nothing else is computed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Needs {
    /// Texture coordinates and the footprint.
    pub texture_point: bool,
    /// Tangents along the surface's parameters.
    pub tangents: bool,
}

/// A hit as materials see it. World space.
#[derive(Clone, Copy, Debug)]
pub struct Surface {
    /// Where textures are looked up; any value unless [`Needs::texture_point`].
    pub texture_point: TexturePoint,
    /// Position.
    pub p: Vec3,
    /// Unit geometric normal.
    pub ng: Vec3,
    /// Unit shading normal.
    pub ns: Vec3,
    /// Change of the position with u; any value unless [`Needs::tangents`].
    pub dpdu: Vec3,
    /// Change of the position with v; as `dpdu`.
    pub dpdv: Vec3,
    /// Unit direction towards where the path came from.
    pub wo: Vec3,
}

/// A material at a hit.
#[derive(Clone, Copy, Debug)]
pub struct Shading<'w> {
    /// Around the perturbed shading normal; its tangent follows u where the material is anisotropic.
    pub frame: Frame,
    /// How light is scattered, in that frame.
    pub bsdf: Bsdf<'w>,
}

#[derive(Clone, Debug)]
struct Material {
    kind: Kind,
    needs: Needs,
    anisotropic: bool,
    displacement: Option<TextureId>,
    /// Index into [`Materials::normal_maps`].
    normal_map: Option<u32>,
}

#[derive(Clone, Debug)]
enum Kind {
    Interface,
    Diffuse {
        reflectance: Value<Rgb>,
    },
    DiffuseTransmission {
        reflectance: Value<Rgb>,
        transmittance: Value<Rgb>,
    },
    Conductor {
        metal: Metal,
        widths: Widths,
    },
    Dielectric {
        eta: f32,
        widths: Widths,
    },
    ThinDielectric {
        eta: f32,
    },
    /// `response`: of the base, by wavelength, where nothing about it is textured.
    CoatedDiffuse {
        reflectance: Value<Rgb>,
        response: Option<Rgb>,
        widths: Widths,
        coat: u32,
    },
    CoatedConductor {
        metal: Metal,
        base: Widths,
        widths: Widths,
        coat: u32,
        table: u32,
    },
    Mix {
        materials: [MaterialId; 2],
        amount: Value<f32>,
    },
}

/// A metal. `relative` divides its index by that of the medium above.
#[derive(Clone, Debug)]
enum Metal {
    /// Index into [`Materials::curves`].
    Curve(u32),
    Index {
        eta: Value<Rgb>,
        k: Value<Rgb>,
        relative: f32,
    },
    Reflectance {
        at_normal: Value<Rgb>,
        relative: f32,
    },
}

/// Widths of a GGX distribution.
#[derive(Clone, Debug)]
enum Widths {
    Constant(Ggx),
    Textured { u: Value<f32>, v: Value<f32>, remap: bool },
}

impl Materials {
    /// What a material looks at.
    #[inline]
    pub fn needs(&self, id: MaterialId) -> Needs {
        self.list[id.index()].needs
    }

    /// The material at a hit; `None` if it is an interface, through which a ray goes on unchanged.
    ///
    /// A mixture chooses one of its materials by a hash of position and direction: an estimate without bias, and the same
    /// for the same path.
    #[inline(always)]
    pub fn shade(&self, id: MaterialId, at: &Surface, textures: &Textures) -> Option<Shading<'_>> {
        let mut material = &self.list[id.index()];
        while let Kind::Mix { materials, amount } = &material.kind {
            let amount = textures.float(amount, &at.texture_point);
            material = &self.list[materials[usize::from(choice(at, *materials) < amount)].index()];
        }
        let bsdf = self.bsdf(&material.kind, &at.texture_point, textures)?;
        Some(Shading { frame: self.frame(material, at, textures), bsdf })
    }

    #[inline]
    fn frame(&self, material: &Material, at: &Surface, textures: &Textures) -> Frame {
        let (mut ns, mut dpdu) = (at.ns, at.dpdu);
        // Of both pbrt-v4 looks at the normal map alone.
        if let Some(map) = material.normal_map {
            ns = perturb::normal_map(at, &self.normal_maps[map as usize]);
        } else if let Some(displacement) = material.displacement {
            (ns, dpdu) = perturb::bump(at, displacement, textures);
        }
        if material.anisotropic { Frame::from_normal_and_tangent(ns, dpdu) } else { Frame::from_normal(ns) }
    }

    #[inline(always)]
    fn bsdf(&self, kind: &Kind, at: &TexturePoint, textures: &Textures) -> Option<Bsdf<'_>> {
        // What reflects more than it receives is no albedo, whatever a texture says.
        let albedo = |value: &Value<Rgb>| textures.rgb(value, at).clamp(Rgb::ZERO, Rgb::ONE);
        Some(match kind {
            Kind::Interface | Kind::Mix { .. } => return None,
            Kind::Diffuse { reflectance } => Bsdf::Diffuse(Diffuse { albedo: albedo(reflectance) }),
            Kind::DiffuseTransmission { reflectance, transmittance } => {
                let (reflectance, transmittance) = (albedo(reflectance), albedo(transmittance));
                Bsdf::DiffuseTransmission(DiffuseTransmission { reflectance, transmittance })
            }
            Kind::Conductor { metal, widths } => {
                let (ggx, fresnel) = (widths.at(at, textures), self.fresnel(metal, at, textures));
                Bsdf::Conductor(Conductor { ggx, fresnel })
            }
            Kind::Dielectric { eta, widths } => {
                Bsdf::Dielectric(Dielectric { eta: *eta, ggx: widths.at(at, textures) })
            }
            Kind::ThinDielectric { eta } => Bsdf::ThinDielectric(ThinDielectric { eta: *eta }),
            Kind::CoatedDiffuse { reflectance, response, widths, coat } => {
                let coat = Coat::new(widths.at(at, textures), &self.coats[*coat as usize]);
                Bsdf::CoatedDiffuse(match response {
                    Some(response) => CoatedDiffuse::with_response(albedo(reflectance), *response, coat),
                    None => CoatedDiffuse::new(albedo(reflectance), coat),
                })
            }
            Kind::CoatedConductor { metal, base, widths, coat, table } => {
                let coat = Coat::new(widths.at(at, textures), &self.coats[*coat as usize]);
                let (base, fresnel) = (base.at(at, textures), self.fresnel(metal, at, textures));
                Bsdf::CoatedConductor(CoatedConductor::new(base, fresnel, coat, &self.metals[*table as usize]))
            }
        })
    }

    #[inline]
    fn fresnel(&self, metal: &Metal, at: &TexturePoint, textures: &Textures) -> ConductorFresnel<'_> {
        match metal {
            Metal::Curve(index) => ConductorFresnel::Table(&self.curves[*index as usize]),
            Metal::Index { eta, k, relative } => {
                ConductorFresnel::Index { eta: textures.rgb(eta, at) / *relative, k: textures.rgb(k, at) / *relative }
            }
            Metal::Reflectance { at_normal, relative } => {
                let k = extinction(textures.rgb(at_normal, at));
                ConductorFresnel::Index { eta: Rgb::ONE / *relative, k: k / *relative }
            }
        }
    }
}

impl Widths {
    #[inline]
    fn at(&self, at: &TexturePoint, textures: &Textures) -> Ggx {
        match self {
            Self::Constant(ggx) => *ggx,
            Self::Textured { u, v, remap } => {
                let width = |value: &Value<f32>| width(textures.float(value, at), *remap);
                Ggx::new(Vec2::new(width(u), width(v)))
            }
        }
    }
}

/// GGX width of an artist's roughness.
///
/// **Source**: pbrt-v4, by behaviour.
#[inline]
fn width(roughness: f32, remap: bool) -> f32 {
    let roughness = roughness.max(0.0);
    if remap { roughness.sqrt() } else { roughness }
}

/// The k at which a conductor of η = 1 has the given reflectance at normal incidence.
///
/// **Source**: (k²)/(4 + k²) = r, solved. A reflectance of 1 would need infinite k: it is held below.
#[inline]
fn extinction(reflectance: Rgb) -> Rgb {
    let r = reflectance.clamp(Rgb::ZERO, Rgb::splat(0.9999));
    2.0 * (r / (Rgb::ONE - r)).map(f32::sqrt)
}

/// A uniform number in [0, 1) that is a function of the hit and of what is chosen from.
#[inline]
fn choice(at: &Surface, materials: [MaterialId; 2]) -> f32 {
    let pair = |a: f32, b: f32| u64::from(a.to_bits()) << 32 | u64::from(b.to_bits());
    let mut hash = mix64(u64::from(materials[0].0) << 32 | u64::from(materials[1].0));
    for word in [pair(at.p.x, at.p.y), pair(at.p.z, at.wo.x), pair(at.wo.y, at.wo.z)] {
        hash = mix64(hash ^ word);
    }
    // The upper 24 bits are exact in f32.
    (hash >> 40) as f32 / (1u32 << 24) as f32
}

#[cfg(test)]
mod tests;
