//! x
use clap::Args;
use super::console::Verbosity;
use super::Exit;
use crate::Result;
/// x
#[derive(Debug, Args)]
pub struct Study { dir: Option<std::path::PathBuf> }
impl Study { pub fn run(&self, v: Verbosity)->Result<Exit>{
    use crate::sweep::*;
    use crate::criterion::Criterion;
    let src = match &self.dir { Some(d) => super::source::Source::Folder(d.clone()), None => super::source::Source::Generated(Default::default()) };
    let t=std::time::Instant::now();
    let c = src.load(&Default::default(), v)?;
    println!("{} {:?}", super::source::counts(&c), t.elapsed());
    let p = crate::profile::Profile::load("paper")?;
    let t=std::time::Instant::now();
    let plan = plan_study(&c.scenarios, &p, &StudyOptions::default())?;
    println!("plan {:?} left {:?} lanes {}", t.elapsed(), plan.left_out, plan.plan.lane_count());
    let plan=plan.plan;
    let t=std::time::Instant::now();
    let mut n=std::collections::BTreeMap::new();
    let mut steps=0u64;
    sweep(&plan, 0..plan.unit_count(), &CpuBackend::lane_arithmetic(), None, Wanted::Verdicts, |ch| { 
        for (k,vd) in ch.verdicts.iter().enumerate() { let key=plan.key(ch.first_lane+k as u64).unwrap(); let e=n.entry((key.block,key.variant,key.model)).or_insert([0u32;5]); e[4]+=1; for c in Criterion::ALL { e[c.index()]+=u32::from(vd.failed(c)); } e[3]+=u32::from(vd.capped()); }
        Ok(()) })?;
    println!("sweep {:?}", t.elapsed());
    for (k,e) in n { if k.1==0 {println!("{} {} {} {e:?}", plan.blocks[k.0].category.label(), plan.blocks[k.0].variants[k.1], plan.models[k.2].name());} }
    let t=std::time::Instant::now();
    sweep(&plan, 0..plan.unit_count(), &CpuBackend::lane_arithmetic(), None, Wanted::Outcomes, |ch| { steps+=ch.outcomes.iter().map(|o| u64::from(o.end_step)+1).sum::<u64>(); Ok(()) })?;
    println!("outcomes {:?} steps {steps}", t.elapsed());
    Ok(Exit::Ok) } }
