//! x
use driftmesh::{density::*, geometry::*, meshing::*, physics::*};
#[test]
fn probe() {
    for (conv, strength, smoothing, fixed) in [(Convection::Conservative,30.0,2,false),(Convection::Advective,30.0,2,false),(Convection::Advective,10.0,0,false),(Convection::Conservative,10.0,1,false),(Convection::Conservative,10.0,1,true),(Convection::Advective,10.0,1,true)] {
    let mut mesh = Mesh::uniform(Lattice::bounded([40,40]).unwrap(), [0.,0.],[1.,1.]).unwrap();
    let mut b = Burgers::new(0.005, conv).unwrap();
    let m = Arclength { strength: Strength::Relative(strength), smoothing, ..Default::default() };
    let mut u = b.initial(0.25, &mesh);
    let mut w = Whole::default();
    let eq = Mmpde::default();
    let now = std::time::Instant::now();
    let mut work = driftmesh::Work::default();
    let mut mw = driftmesh::Work::default();
    let (mut tm, mut tp, mut td) = (0.0,0.0,0.0);
    for n in 0..1000 {
        let t = 0.25 + n as f64*1e-3;
        let s=std::time::Instant::now();
        let rho = m.density(&mesh, u.values()).unwrap();
        td+=s.elapsed().as_secs_f64(); let s=std::time::Instant::now();
        let new = if fixed {mesh.clone()} else { let (new, wk) = w.step(&eq, &mesh, &rho, 1e-3).unwrap(); mw+=wk; new};
        check_unfolded(&new).unwrap();
        tm+=s.elapsed().as_secs_f64(); let s=std::time::Instant::now();
        let (v, wk) = b.step(Motion{t, dt:1e-3, old:&mesh,new:&new}, &u).unwrap();
        tp+=s.elapsed().as_secs_f64();
        work += wk;
        mesh=new; u=v;
        if [499,749,999].contains(&n) {
            let e = b.exact(t+1e-3,&mesh).unwrap();
            let linf = e.values().iter().zip(u.values()).fold(0.0f64,|m,(a,b)|m.max((a-b).abs()));
            let q=quality(&mesh,&rho);
            println!("{n} {linf:.5} {:.4} {:.4} jac {:.5} x10 {:.6}", q.q_max,q.q_mean,q.min_scaled_jacobian, mesh.x()[10*41+10][0]);
        }
    }
    println!("{:?} phys {work:?} mesh {mw:?} times density {td:.3} mesh {tm:.3} pde {tp:.3}", now.elapsed());
    }
}
