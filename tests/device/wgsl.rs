//! Questions to a WGSL source, as naga understands it.

use naga::valid::{Capabilities, ModuleInfo, ValidationFlags, Validator};
use naga::{BinaryOperator, Block, Expression, Function, Handle, Literal, LocalVariable, MathFunction, Module};
use naga::{ScalarKind, Statement, TypeInner};

/// A source that parses and validates with all flags and without any capability.
pub fn parse(source: &str) -> (Module, ModuleInfo) {
    let module = naga::front::wgsl::parse_str(source).unwrap_or_else(|e| panic!("{}", e.emit_to_string(source)));
    let validated = Validator::new(ValidationFlags::all(), Capabilities::empty()).validate(&module);
    let info = validated.unwrap_or_else(|e| panic!("{}", e.emit_to_string(source)));
    (module, info)
}

/// One field of a record: bytes, and the type by its Rust name without type arguments.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Shape {
    pub name: String,
    pub offset: usize,
    pub size: usize,
    pub kind: String,
}

/// Stride of a struct in an array, bytes, and its fields in their order.
pub fn fields(module: &Module, name: &str) -> (usize, Vec<Shape>) {
    let mut layouter = naga::proc::Layouter::default();
    layouter.update(module.to_ctx()).unwrap();
    let (handle, ty) = module.types.iter().find(|(_, ty)| ty.name.as_deref() == Some(name)).unwrap();
    let TypeInner::Struct { members, .. } = &ty.inner else { panic!("{name} is no struct") };
    let shapes = members.iter().map(|member| Shape {
        name: member.name.clone().unwrap(),
        offset: member.offset as usize,
        size: layouter[member.ty].size as usize,
        kind: kind(module, member.ty),
    });
    (layouter[handle].to_stride() as usize, shapes.collect())
}

fn kind(module: &Module, ty: Handle<naga::Type>) -> String {
    let ty = &module.types[ty];
    match &ty.inner {
        TypeInner::Scalar(naga::Scalar { kind: ScalarKind::Uint, width: 4 }) => "u32".into(),
        TypeInner::Scalar(naga::Scalar { kind: ScalarKind::Float, width: 4 }) => "f32".into(),
        TypeInner::Struct { .. } => ty.name.clone().unwrap(),
        TypeInner::Array { base, size: naga::ArraySize::Constant(count), .. } => {
            format!("[{};{count}]", kind(module, *base))
        }
        other => format!("{other:?}"),
    }
}

/// Value of a constant that is a u32, or the bits of one that is an f32.
pub fn constant(module: &Module, name: &str) -> u32 {
    let found = module.constants.iter().find(|(_, constant)| constant.name.as_deref() == Some(name));
    let (_, constant) = found.unwrap_or_else(|| panic!("no constant {name}"));
    match module.global_expressions[constant.init] {
        Expression::Literal(Literal::U32(value)) => value,
        Expression::Literal(Literal::F32(value)) => value.to_bits(),
        ref other => panic!("{name} is {other:?}"),
    }
}

/// The text without `//` comments, line by line.
pub fn without_comments(text: &str) -> String {
    text.lines().flat_map(|line| [line.split("//").next().unwrap(), "\n"]).collect()
}

/// Names of the functions of a Rust or WGSL text, in their order.
pub fn function_names(text: &str) -> Vec<String> {
    let code = without_comments(text);
    let words = code.match_indices("fn ").filter(|(at, _)| !code[..*at].ends_with(|c: char| c.is_alphanumeric()));
    let names = words.map(|(at, word)| {
        code[at + word.len()..].chars().take_while(|c| c.is_ascii_alphanumeric() || *c == '_').collect::<String>()
    });
    names.filter(|name| !name.is_empty()).collect()
}

#[derive(Debug, Default)]
pub struct FloatOperations {
    /// Built-in functions other than the magnitude, remainders, anything else that devices differ on.
    pub forbidden: Vec<String>,
    pub divided_in: Vec<String>,
}

pub fn float_operations(module: &Module, info: &ModuleInfo) -> FloatOperations {
    let mut found = FloatOperations::default();
    let entries = module.entry_points.iter().enumerate().map(|(at, e)| (&e.function, info.get_entry_point(at)));
    let functions = module.functions.iter().map(|(handle, function)| (function, &info[handle]));
    for (function, types) in functions.chain(entries) {
        let name = function.name.clone().unwrap_or_else(|| "the entry".into());
        for (handle, expression) in function.expressions.iter() {
            let is_float = types[handle].ty.inner_with(&module.types).scalar_kind() == Some(ScalarKind::Float);
            match expression {
                Expression::Binary { op: BinaryOperator::Divide, .. } if is_float => {
                    found.divided_in.push(name.clone());
                }
                Expression::Binary { op: BinaryOperator::Modulo, .. } if is_float => {
                    found.forbidden.push(format!("{name}: remainder of floats"));
                }
                Expression::Math { fun: MathFunction::Abs, .. } => {}
                // Of integers, in which devices do not differ.
                Expression::Math { fun: MathFunction::CountLeadingZeros | MathFunction::CountOneBits, .. } => {}
                Expression::Math { .. } | Expression::Derivative { .. } | Expression::Relational { .. } => {
                    found.forbidden.push(format!("{name}: {expression:?}"));
                }
                _ => {}
            }
        }
    }
    found
}

/// Number of loops of a module, and what is wrong with those that no constant bounds.
///
/// A bounded loop is `for (…; k < LIMIT; k++)`: it begins by leaving unless a local variable is less than a
/// literal, a constant or an override; the variable is written in one place, after each round, where it grows by
/// one; and nobody gets a pointer to it. Then it ends after LIMIT rounds at most, wherever it starts, because every
/// value below LIMIT has a successor. Calls cannot form a loop: WGSL has no recursion.
pub fn unbounded_loops(module: &Module) -> (usize, Vec<String>) {
    let functions = module.functions.iter().map(|(_, function)| function);
    let (mut loops, mut unbounded) = (0, Vec::new());
    for function in functions.chain(module.entry_points.iter().map(|entry| &entry.function)) {
        walk(&function.body, &mut |statement| {
            if let Statement::Loop { body, continuing, .. } = statement {
                loops += 1;
                if let Err(why) = bound(module, function, body, continuing) {
                    unbounded.push(format!("{}: {why}", function.name.as_deref().unwrap_or("the entry")));
                }
            }
        });
    }
    (loops, unbounded)
}

/// Lines that declare a variable inside a loop without an initial value. Devices differ on what it holds in the second
/// round (wgpu 9489).
pub fn uninitialized_in_loops(text: &str) -> Vec<String> {
    let (mut open, mut found) = (Vec::new(), Vec::new());
    for line in without_comments(text).lines() {
        let words: Vec<&str> = line.split(|c: char| !c.is_ascii_alphanumeric() && c != '_').collect();
        if open.contains(&true) && words.contains(&"var") && line.trim_end().ends_with(';') && !line.contains('=') {
            found.push(line.trim().to_owned());
        }
        let begins_loop = ["for", "while", "loop"].iter().any(|word| words.contains(word));
        for c in line.chars() {
            match c {
                '{' => open.push(begins_loop),
                '}' => drop(open.pop()),
                _ => {}
            }
        }
    }
    found
}

fn walk(block: &Block, look: &mut impl FnMut(&Statement)) {
    for statement in block {
        look(statement);
        match statement {
            Statement::Block(inner) => walk(inner, look),
            Statement::If { accept, reject, .. } => {
                walk(accept, look);
                walk(reject, look);
            }
            Statement::Switch { cases, .. } => cases.iter().for_each(|case| walk(&case.body, look)),
            Statement::Loop { body, continuing, .. } => {
                walk(body, look);
                walk(continuing, look);
            }
            _ => {}
        }
    }
}

fn bound(module: &Module, function: &Function, body: &Block, continuing: &Block) -> Result<(), String> {
    let counter = counter(function, body).ok_or("does not begin by leaving unless a counter is below a constant")?;
    let is_counter = |pointer| matches!(function.expressions[pointer], Expression::LocalVariable(at) if at == counter);
    let mut problem = None;
    let (mut written, mut grows) = (0, 0);
    for (block, after_the_round) in [(body, false), (continuing, true)] {
        walk(block, &mut |statement| match statement {
            Statement::Store { pointer, value } if is_counter(*pointer) => {
                written += 1;
                grows += usize::from(after_the_round && is_one_more(function, counter, *value));
            }
            Statement::Call { arguments, .. } if arguments.iter().any(|&a| is_counter(a)) => {
                problem = Some("its counter is given away");
            }
            _ => {}
        });
    }
    let is_whole = matches!(
        module.types[function.local_variables[counter].ty].inner,
        TypeInner::Scalar(naga::Scalar { kind: ScalarKind::Uint | ScalarKind::Sint, .. })
    );
    if !is_whole {
        problem = Some("its counter is no integer");
    }
    if (written, grows) != (1, 1) || !continuing.iter().any(|s| matches!(s, Statement::Store { .. })) {
        problem = Some("its counter does not grow by one after each round, and only there");
    }
    problem.map_or(Ok(()), |why| Err(why.into()))
}

/// The variable that a loop's first statement compares with a limit.
fn counter(function: &Function, body: &Block) -> Option<Handle<LocalVariable>> {
    let first = body.iter().find(|statement| !matches!(statement, Statement::Emit(_)))?;
    let Statement::If { condition, accept, reject } = first else { return None };
    let leaves = accept.is_empty() && matches!(reject.iter().as_slice(), [Statement::Break]);
    let Expression::Binary { op: BinaryOperator::Less, left, right } = function.expressions[*condition] else {
        return None;
    };
    let limit = &function.expressions[right];
    let is_fixed = matches!(limit, Expression::Literal(_) | Expression::Constant(_) | Expression::Override(_));
    if leaves && is_fixed { loaded(function, left) } else { None }
}

fn loaded(function: &Function, expression: Handle<Expression>) -> Option<Handle<LocalVariable>> {
    let Expression::Load { pointer } = function.expressions[expression] else { return None };
    let Expression::LocalVariable(variable) = function.expressions[pointer] else { return None };
    Some(variable)
}

fn is_one_more(function: &Function, counter: Handle<LocalVariable>, value: Handle<Expression>) -> bool {
    let Expression::Binary { op: BinaryOperator::Add, left, right } = function.expressions[value] else { return false };
    let is_one = matches!(function.expressions[right], Expression::Literal(Literal::U32(1) | Literal::I32(1)));
    loaded(function, left) == Some(counter) && is_one
}
