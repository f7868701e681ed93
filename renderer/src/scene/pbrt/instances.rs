//! Places objects: instances within objects become instances in the world, since what is drawn has one level of them.

use std::collections::BTreeMap;

use super::context::Context;
use super::report::{did_you_mean, shown};
use super::world::{InstanceEntity, ObjectEntity};
use crate::math::Transform;
use crate::scene::Span;
use crate::scene::description::{Instance, ObjectId};

/// Objects that hold objects multiply: beyond this the file cannot be meant.
const MOST_INSTANCES: usize = 1 << 24;

/// Objects within each other beyond this, too.
const DEEPEST: usize = 100;

/// The instances of a scene, of which `names` are the objects' names by number.
pub(super) fn place(
    cx: &mut Context,
    entities: &[ObjectEntity],
    names: Vec<(String, Span)>,
    placed: &[InstanceEntity],
) -> Vec<Instance> {
    let mut index: BTreeMap<&str, usize> = BTreeMap::new();
    for (at, entity) in entities.iter().enumerate() {
        index.entry(&entity.name).or_insert(at);
    }
    let find = |(name, span): &(String, Span)| {
        let found = index.get(name.as_str()).copied();
        if found.is_none() {
            let hint = did_you_mean(name, index.keys().copied());
            cx.report.error(*span, format!("there is no object \"{}\"{hint}", shown(name)));
        }
        found
    };
    let targets: Vec<Option<usize>> = names.iter().map(find).collect();
    let mut flattener = Flattener { targets, entities, counts: vec![Count::Unknown; entities.len()], out: Vec::new() };
    for object in 0..entities.len() {
        flattener.count(cx, object, 0);
    }
    for instance in placed {
        flattener.place(cx, instance, &Transform::default());
    }
    flattener.out
}

/// What one instance of an object becomes.
#[derive(Clone, Copy)]
enum Count {
    Unknown,
    /// Being counted: met again, the object holds itself.
    Open,
    /// That many instances in the world, from objects that many levels deep.
    Known {
        instances: usize,
        levels: usize,
    },
}

struct Flattener<'e> {
    /// The objects that the numbers of names stand for.
    targets: Vec<Option<usize>>,
    entities: &'e [ObjectEntity],
    counts: Vec<Count>,
    out: Vec<Instance>,
}

impl Flattener<'_> {
    /// Counts what an object becomes, which is met `depth` objects deep: instances and levels.
    fn count(&mut self, cx: &mut Context, object: usize, depth: usize) -> (usize, usize) {
        if let Count::Known { instances, levels } = self.counts[object] {
            return (instances, levels);
        }
        self.counts[object] = Count::Open;
        let entity = &self.entities[object];
        let (mut instances, mut levels) = (usize::from(!entity.shapes.is_empty()), 1);
        for inner in &entity.instances {
            let Some(target) = self.targets[inner.name as usize] else { continue };
            if matches!(self.counts[target], Count::Open) {
                let name = shown(&self.entities[target].name);
                cx.report.error(inner.span, format!("object \"{name}\" holds an instance of itself"));
                continue;
            }
            let below = if depth < DEEPEST { self.count(cx, target, depth + 1) } else { (0, DEEPEST) };
            instances = instances.saturating_add(below.0);
            levels = levels.max(below.1 + 1);
            if levels > DEEPEST {
                cx.report.error(inner.span, format!("more than {DEEPEST} objects within each other"));
                // Told: what holds this object need not tell it again.
                levels = 1;
            }
        }
        self.counts[object] = Count::Known { instances, levels };
        (instances, levels)
    }

    /// Adds the instances that an instance becomes. Does nothing after an error: then the depth is not known.
    fn place(&mut self, cx: &mut Context, instance: &InstanceEntity, outer: &Transform) {
        let Some(object) = self.targets[instance.name as usize] else { return };
        let Count::Known { instances, .. } = self.counts[object] else { return };
        if cx.report.failed() || instances == 0 {
            return;
        }
        if self.out.len().saturating_add(instances) > MOST_INSTANCES {
            let text = format!("more than {MOST_INSTANCES} instances, those within objects counted");
            cx.report.error(instance.span, text);
            return;
        }
        let entity = &self.entities[object];
        let world_from_object = *outer * instance.transform;
        if !entity.shapes.is_empty() {
            self.out.push(Instance { object: ObjectId(object as u32), world_from_object, span: instance.span });
        }
        for inner in &entity.instances {
            self.place(cx, inner, &world_from_object);
        }
    }
}
