//! The state machine of a scene file: what each directive does to the state, and what it adds to the scene.

use std::collections::{BTreeMap, HashSet};
use std::path::{Path, PathBuf};

use super::context::Context;
use super::lexer::Lexer;
use super::options::Options;
use super::params::Params;
use super::report::{did_you_mean, shown};
use super::source::{Cursor, read_file};
use super::spectra::SPACES;
use super::state::{self, CoordinateSystems, State, Transforms};
use super::syntax::{Directive, read_directive};
use super::world::{InstanceEntity, ObjectEntity, World};
use crate::math::Transform;
use crate::scene::{PathMap, Span};
use crate::spectrum::RgbSpace;

/// Files within files beyond this include themselves or are not meant to be read.
const DEEPEST_INCLUDE: usize = 64;

/// Files beyond this are an accident: files that each include another one twice double with every level.
const MOST_INCLUDES: usize = 1 << 20;

/// What an end directive has to close.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Block {
    Attribute,
    Object,
}

/// The reader of a scene.
pub(super) struct Reader {
    pub(super) cx: Context,
    pub(super) options: Options,
    pub(super) world: World,
    in_world: bool,
    pub(super) state: State,
    stack: Vec<(Block, Span, State)>,
    pub(super) systems: CoordinateSystems,
    /// The numbers of named materials in `world.material_refs`.
    pub(super) named_materials: BTreeMap<String, u32>,
    /// The objects that were defined.
    object_names: HashSet<String>,
    /// Index of the object that is being defined.
    pub(super) open_object: Option<usize>,
    /// The files that are being read, innermost last.
    open_files: Vec<PathBuf>,
    includes: usize,
}

impl Reader {
    pub(super) fn new(folder: PathBuf, map: PathMap) -> Self {
        Self {
            cx: Context::new(folder, map),
            options: Options::default(),
            world: World::default(),
            in_world: false,
            state: State::default(),
            stack: Vec::new(),
            systems: CoordinateSystems::new(),
            named_materials: BTreeMap::new(),
            object_names: HashSet::new(),
            open_object: None,
            open_files: Vec::new(),
            includes: 0,
        }
    }

    /// Reads the text of a scene and everything that it includes.
    pub(super) fn read(&mut self, path: &Path, text: Vec<u8>) {
        self.open_files.push(path.canonicalize().unwrap_or_else(|_| path.to_owned()));
        self.read_text(path, text, None);
        self.open_files.pop();
        self.close_all();
        if !self.in_world {
            self.cx.report.error_nowhere("the scene has no WorldBegin: there is nothing to see");
        }
    }

    /// Reads one file. `from` is where it was included.
    fn read_text(&mut self, path: &Path, text: Vec<u8>, from: Option<Span>) {
        let (file, text) = match self.cx.files.add(path, text) {
            Ok(added) => added,
            Err(why) => {
                let text = format!("{}: {why}", path.display());
                match from {
                    Some(span) => self.cx.report.error(span, text),
                    None => self.cx.report.error_nowhere(text),
                }
                return;
            }
        };
        if text.starts_with(&[0xfe, 0xff]) || text.starts_with(&[0xff, 0xfe]) {
            self.cx.report.error(Span { file, start: 0, end: 2 }, "the file is UTF-16: save it as UTF-8");
            return;
        }
        let mut lexer = Lexer::new(&text);
        loop {
            let mut cursor = Cursor::new(lexer, file, &mut self.cx.report);
            let directive = match read_directive(&mut cursor, self.state.color_space) {
                None => break,
                Some(Ok(directive)) => Some(directive),
                Some(Err(_)) => {
                    cursor.recover();
                    None
                }
            };
            lexer = cursor.into_lexer();
            if let Some((directive, span)) = directive {
                self.apply(directive, span);
            }
        }
    }

    /// Tells what was opened and never closed, and closes it.
    fn close_all(&mut self) {
        for (block, span, state) in self.stack.drain(..).rev() {
            let text = match block {
                Block::Attribute => "AttributeBegin has no AttributeEnd",
                Block::Object => "ObjectBegin has no ObjectEnd",
            };
            self.cx.report.error(span, text);
            self.state = state;
        }
    }

    fn apply(&mut self, directive: Directive, span: Span) {
        match directive {
            Directive::Identity => self.state.set(Transform::default()),
            Directive::Translate(by) => self.state.concat(state::translate(by)),
            Directive::Scale(by) => self.concat(state::scale(by), span, "a factor of 0 has no inverse"),
            Directive::Rotate(by) => self.concat(state::rotate(by), span, "the axis has no length"),
            Directive::LookAt(at) => {
                self.concat(state::look_at(at), span, "the eye is at its target, or up is along the view");
            }
            Directive::ConcatTransform(m) => self.concat(state::matrix(m), span, "the matrix has no inverse"),
            Directive::Transform(m) => match state::matrix(m) {
                Some(transform) => self.state.set(transform),
                None => self.cx.report.error(span, "the matrix has no inverse"),
            },
            // The times between which a shape moves: motion is not rendered, and is warned of where it happens.
            Directive::TransformTimes => self.only_before_world("TransformTimes", span),
            Directive::ActiveTransform(active) => self.state.active = active,
            Directive::CoordinateSystem(name) => {
                self.systems.insert(name, self.state.transforms);
            }
            Directive::CoordSysTransform(name) => self.coord_sys_transform(&name, span),
            Directive::ColorSpace(name) => self.color_space(&name, span),
            Directive::ReverseOrientation => {
                self.only_in_world("ReverseOrientation", span);
                self.state.reverse_orientation = !self.state.reverse_orientation;
            }
            Directive::AttributeBegin => self.open(Block::Attribute, "AttributeBegin", span),
            Directive::AttributeEnd => self.close(Block::Attribute, "AttributeEnd", span),
            Directive::TransformBegin => {
                let text = "TransformBegin and TransformEnd are the older names of AttributeBegin and AttributeEnd";
                self.cx.report.warning("TransformBegin", span, text);
                self.open(Block::Attribute, "TransformBegin", span);
            }
            Directive::TransformEnd => self.close(Block::Attribute, "TransformEnd", span),
            Directive::WorldBegin => self.world_begin(span),
            Directive::WorldEnd => {
                self.cx.report.warning("WorldEnd", span, "WorldEnd belongs to older versions of the format: ignored");
            }
            Directive::ObjectBegin(name) => self.object_begin(name, span),
            Directive::ObjectEnd => self.object_end(span),
            Directive::ObjectInstance(name) => self.object_instance(name, span),
            Directive::NamedMaterial(name) => self.named_material(name, span),
            Directive::MediumInterface(inside, outside) => self.medium_interface(inside, outside, span),
            Directive::Include(name) => self.include(&name, span),
            Directive::Import(name) => self.import(&name, span),
            Directive::Option { name, value } => self.options.set(&mut self.cx, &name, &value, span),
            Directive::Texture { name, values, class, params } => {
                self.only_in_world("Texture", span);
                let params = Params::new("texture", class, span, params, &self.state.attributes.texture);
                self.texture(name, &values, params);
            }
            Directive::Entity(entity, name, params) => self.entity(entity, name, params, span),
        }
    }

    fn concat(&mut self, transform: Option<Transform>, span: Span, why_not: &str) {
        match transform {
            Some(transform) => self.state.concat(transform),
            None => self.cx.report.error(span, why_not),
        }
    }

    pub(super) fn only_in_world(&mut self, name: &str, span: Span) {
        if !self.in_world {
            self.cx.report.error(span, format!("{name} belongs after WorldBegin"));
        }
    }

    pub(super) fn only_before_world(&mut self, name: &str, span: Span) {
        if self.in_world {
            self.cx.report.error(span, format!("{name} belongs before WorldBegin"));
        }
    }

    fn coord_sys_transform(&mut self, name: &str, span: Span) {
        if let Some(transforms) = self.systems.get(name) {
            self.state.transforms = *transforms;
            return;
        }
        let mut known: Vec<&str> = self.systems.keys().map(String::as_str).collect();
        known.sort_unstable();
        let hint = did_you_mean(name, known);
        self.cx.report.error(span, format!("there is no coordinate system \"{}\"{hint}", shown(name)));
    }

    fn color_space(&mut self, name: &str, span: Span) {
        match RgbSpace::named(name) {
            Some(space) => self.state.color_space = space,
            None => self.cx.unknown_type("colour space", name, span, &SPACES),
        }
    }

    fn open(&mut self, block: Block, name: &str, span: Span) {
        // More levels than any scene has, and as many as a file of nothing else may cost.
        const DEEPEST: usize = 10_000;
        self.only_in_world(name, span);
        if self.stack.len() == DEEPEST {
            self.cx.report.error(span, format!("more than {DEEPEST} blocks within each other"));
        }
        if self.stack.len() < DEEPEST {
            self.stack.push((block, span, self.state.clone()));
        }
    }

    fn close(&mut self, block: Block, name: &str, span: Span) {
        match self.stack.last() {
            Some((open, ..)) if *open == block => {
                if let Some((_, _, state)) = self.stack.pop() {
                    self.state = state;
                }
            }
            Some((Block::Object, ..)) => {
                self.cx.report.error(span, format!("{name} within an object: the open block is an ObjectBegin"));
            }
            Some(_) => self.cx.report.error(span, format!("{name}, but the open block is an AttributeBegin")),
            None => self.cx.report.error(span, format!("{name} has nothing to end")),
        }
    }

    fn world_begin(&mut self, span: Span) {
        if self.in_world {
            self.cx.report.error(span, "WorldBegin is given twice");
            return;
        }
        self.in_world = true;
        self.state.transforms = Transforms::default();
        self.state.active = [true, true];
        self.systems.insert("world".to_owned(), self.state.transforms);
    }

    /// The transform at the start of the shutter; motion is told and not drawn.
    pub(super) fn placed(&mut self, what: &str, span: Span) -> Transform {
        if self.state.moves() {
            let text = format!("motion is not rendered: this {what} is drawn where it starts");
            self.cx.report.warning(format!("motion {what}"), span, text);
        }
        self.state.transforms[0]
    }

    fn object_begin(&mut self, name: String, span: Span) {
        self.open(Block::Object, "ObjectBegin", span);
        if self.open_object.is_some() {
            self.cx.report.error(span, "ObjectBegin within an object");
            return;
        }
        if !self.object_names.insert(name.clone()) {
            self.cx.report.error(span, format!("there is already an object \"{}\"", shown(&name)));
        }
        self.open_object = Some(self.world.objects.len());
        let (shapes, instances) = (Vec::new(), Vec::new());
        self.world.objects.push(ObjectEntity { name: name.into(), shapes, instances, span });
    }

    fn object_end(&mut self, span: Span) {
        let depth = self.stack.len();
        self.close(Block::Object, "ObjectEnd", span);
        let closed = self.stack.len() < depth;
        if closed && !self.stack.iter().any(|(block, ..)| *block == Block::Object) {
            self.open_object = None;
        }
    }

    fn object_instance(&mut self, name: String, span: Span) {
        self.only_in_world("ObjectInstance", span);
        let transform = self.placed("object instance", span);
        let name = self.world.object_names.intern(name, span);
        let instance = InstanceEntity { name, transform, span };
        match self.open_object {
            Some(object) => self.world.objects[object].instances.push(instance),
            None => self.world.instances.push(instance),
        }
    }

    fn include(&mut self, name: &str, span: Span) {
        let path = self.cx.files.resolve(name, span.file);
        // Two names of one file are the same file.
        let identity = path.canonicalize().unwrap_or_else(|_| path.clone());
        if self.open_files.contains(&identity) || self.open_files.len() == DEEPEST_INCLUDE {
            let why = if self.open_files.contains(&identity) { "includes itself" } else { "is included too deep" };
            self.cx.report.error(span, format!("{} {why}", path.display()));
            return;
        }
        self.includes += 1;
        if self.includes > MOST_INCLUDES {
            if self.includes == MOST_INCLUDES + 1 {
                self.cx.report.error(span, format!("more than {MOST_INCLUDES} files are included"));
            }
            return;
        }
        match read_file(&path) {
            Ok(text) => {
                self.open_files.push(identity);
                self.read_text(&path, text, Some(span));
                self.open_files.pop();
            }
            Err(why) => self.cx.report.error(span, format!("{}: {why}", path.display())),
        }
    }

    /// As `include`, except that what the file changes of the state ends with it, and that it may not end what it did
    /// not begin.
    fn import(&mut self, name: &str, span: Span) {
        if !self.in_world {
            return self.only_in_world("Import", span);
        }
        let state = self.state.clone();
        let systems = self.systems.clone();
        let stack = std::mem::take(&mut self.stack);
        let open_object = self.open_object;
        self.include(name, span);
        self.close_all();
        (self.state, self.systems, self.stack, self.open_object) = (state, systems, stack, open_object);
    }
}
