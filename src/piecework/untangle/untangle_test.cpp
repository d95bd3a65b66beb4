#include <piecework/untangle/untangle.hpp>
#include <gtest/gtest.h>
#include <iostream>
#include <numbers>
#include <piecework/mesh/solids.hpp>
#include "untangle_test_util.hpp"
namespace piecework::untangle {
namespace {
void show(const char* name, TangledCloth& c) {
  const auto before = c.intersections();
  const auto r = c.untangle();
  const auto s = c.stretches();
  std::cout << name << ": exact " << before << " -> " << c.intersections() << "; edges " << r.before.edges << "->" << r.after.edges
            << " inside " << r.before.inside << "->" << r.after.inside << " rounds " << r.rounds << " move " << r.largest_move
            << " stretch " << s[0] << " .. " << s[1] << "\n";
}
mesh::TriangleMesh vertical(double size, int n, double x0, double y0, double z0) {
  auto m = testing::grid_mesh(n, n, size);
  Positions p = m.positions;
  m.positions.col(0) = p.col(0).array() + x0;
  m.positions.col(1) = p.col(2).array() + y0;
  m.positions.col(2).setConstant(z0);
  return m;
}
colliders::MeshCollider body(const mesh::TriangleMesh& m, Vec3 at) {
  Eigen::Affine3d a = Eigen::Affine3d::Identity(); a.translation() = at;
  return {{.name = "b"}, m, a, {}};
}
TEST(Explore, All) {
  { TangledCloth c(testing::disjoint_union(testing::grid_mesh(21, 21), vertical(1, 21, 0.013, -0.487, 0.507))); show("perpendicular", c); }
  { TangledCloth c(testing::disjoint_union(testing::grid_mesh(21, 21), vertical(1, 21, 0.013, -0.187, 0.507))); show("perpendicular 0.19", c); }
  { TangledCloth c(testing::disjoint_union(testing::grid_mesh(21, 21), vertical(0.5, 11, 0.213, -0.187, 0.507))); show("narrow 0.19", c); }
  { TangledCloth c(testing::disjoint_union(testing::grid_mesh(21, 21), vertical(1, 21, 0.513, -0.487, 0.507))); show("crossing at borders", c); }
  { auto a = testing::grid_mesh(21, 21); auto b = a; b.positions.col(1) = 0.02 + 0.05*(a.positions.col(0).array()*9).sin(); 
    b.positions.col(0).array() += 0.003; b.positions.col(2).array() += 0.007; TangledCloth c(testing::disjoint_union(a, b)); show("waves", c); }
  { auto a = testing::grid_mesh(21, 21); TangledCloth c(a); c.x(220,1)=0; // fold
    for (int v=0; v<c.x.rows(); ++v){ double s=c.model.start(v,0); double t=(s-0.5)*5.2; c.x(v,0)=0.3*std::sin(t)*1.0; c.x(v,1)=0.3*(1-std::cos(t)); c.x(v,2)+=0.01*s; 
      if(s>0.8) {c.x(v,0)-=0;} }
    for (int v=0; v<c.x.rows(); ++v){ double s=c.model.start(v,0); if (s<0.5) c.x(v,0)+=0; double t=(s-0.5)*7.0; c.x(v,0)=std::sin(t)/7.0; c.x(v,1)=(1-std::cos(t))/7.0; c.x(v,2)=c.model.start(v,2)+0.0*s; }
    show("loop", c); }
  { TangledCloth c(testing::grid_mesh(21, 21)); c.meshes.push_back(body(mesh::icosphere(0.3, 8), {0.5, -0.2, 0.5})); show("icosphere cap", c); }
  { TangledCloth c(testing::grid_mesh(21, 21)); c.meshes.push_back(body(mesh::icosphere(0.3, 8), {0.5, -0.05, 0.5})); show("icosphere nearly half", c); }
  { TangledCloth c(testing::grid_mesh(21, 21)); c.meshes.push_back(body(mesh::icosphere(0.3, 8), {0.0, 0.01, 0.5})); show("icosphere from aside", c); }
  { TangledCloth c(testing::grid_mesh(21, 21,0.5)); c.meshes.push_back(body(mesh::box({1,0.4,1}), {-0.3, 0.05, 0.25})); show("box from aside", c); }
  { TangledCloth c(testing::grid_mesh(21, 21,1)); c.meshes.push_back(body(mesh::box({0.5,0.4,0.5}), {0.5, -0.15, 0.5})); show("box below", c); }
  { TangledCloth c(testing::grid_mesh(21, 21,1)); c.meshes.push_back(body(mesh::box({0.5,0.4,0.5}), {0.5, -0.2, 0.5})); show("box coplanar", c); }
  { TangledCloth c(testing::grid_mesh(21, 21)); c.options.self=false; c.bodies.push_back({{.name="s"}, colliders::Sphere{{0.5,-0.2,0.5},0.3}, Eigen::Isometry3d::Identity(), {}}); show("analytic sphere", c); }
  { TangledCloth c(testing::disjoint_union(testing::grid_mesh(21, 21), testing::grid_mesh(21, 21))); show("identical", c); }
  { auto b = testing::grid_mesh(21,21); b.positions.col(0).array() += 0.31; TangledCloth c(testing::disjoint_union(testing::grid_mesh(21, 21), b)); show("coplanar", c); }
  { auto a=testing::grid_mesh(21,21); auto b=a; b.positions.col(1).array()+=0.01; TangledCloth c(testing::disjoint_union(a,b)); c.x(220,1)=0.05; show("one vertex", c); }
  { auto a=testing::grid_mesh(21,21); auto b=a; b.positions.col(1).array()-=0.01; b.positions.col(0).array()+=0.613; b.positions.col(2).array()+=0.613;
    TangledCloth c(testing::disjoint_union(a,b)); c.x(441,1)=0.05; show("corner", c); }
  auto tube=[](double r,int n,int rows){ mesh::TriangleMesh m; for(int j=0;j<rows;++j)for(int i=0;i<n;++i){} 
    m.positions.resize(n*rows,3); for(int j=0;j<rows;++j)for(int i=0;i<n;++i){double a=2*std::numbers::pi*i/n; m.positions.row(j*n+i)<<r*std::cos(a),0.05*j,r*std::sin(a);}
    for(int j=0;j+1<rows;++j)for(int i=0;i<n;++i){int a=j*n+i,b=j*n+(i+1)%n; m.triangles.push_back({a,a+n,b}); m.triangles.push_back({b,a+n,b+n});} return m; };
  { auto a=tube(0.3,40,20), b=tube(0.32,37,20); b.positions.col(0).array()+=0.05; b.positions.col(1).array()-=0.013; TangledCloth c(testing::disjoint_union(a,b)); show("tubes", c); }
  { TangledCloth c(tube(0.3,40,20)); auto b=mesh::lathe(std::vector<Vec2>{{0,-0.3},{0.31,-0.3},{0.31,1.3},{0,1.3}},48); c.meshes.push_back(body(b,{0,0,0})); show("tube in cylinder body", c); }
  { TangledCloth c(tube(0.3,40,20)); auto b=mesh::icosphere(0.33,10); c.meshes.push_back(body(b,{0,0.45,0})); show("tube around sphere", c); }
}
}}
