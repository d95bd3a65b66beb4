#pragma once

// Private to the module: the one declaration of every key of a scene. A visitor is handed each
// key with the member it fills; the reader, the resolved scene, the JSON Schema and the reference
// page are four visitors. Defaults are those of the structs in scene.hpp.
//
// A visitor has
//   about(const char* title, const char* doc)     first, once per struct
//   value(const Key&, T&, const Range& = {})      T: double, int, bool, std::string, and
//   std::array,
//                                                 std::vector, std::optional of these
//   choice(const Key&, std::string&, const Choices&)
//   preset(const Key&, std::string&, T& target, const Presets<T>&)    a choice that sets the
//                                                 defaults of the keys declared after it
//   object(const Key&, T&)                        T: a struct, or std::optional of one
//   list(const Key&, std::vector<T>&)             structs in order
//   map(const Key&, std::map<std::string, T>&)    structs by name
//   exactly_one(const Names&), at_least_one(const Names&)    which keys must be given
//
// Whether a key `applies` may depend on members declared before it.

#include <piecework/scene/body_fields.hpp>
#include <piecework/scene/cloth_fields.hpp>
#include <piecework/scene/scene.hpp>
#include <piecework/scene/scene_keys.hpp>
#include <piecework/scene/solver_fields.hpp>

namespace piecework::scene {

template <class V>
void fields(V& v, Step& s) {
  v.about("Step", "Time stepping: implicit Euler with a fixed step.");
  v.value({"h", "time step", "s"}, s.h, above(0, 10));
  v.value({"steps", "steps to simulate"}, s.steps, between(0, 1e9));
  v.value({"output_every", "steps per frame"}, s.output_every, between(1, 1e9));
}

template <class V>
void fields(V& v, Wind& w) {
  v.about("Wind",
          "Moving air that drags the cloth along: per triangle of area A the force rho/2 A |u| "
          "(C_n u_n + "
          "C_t u_t), u the air's velocity relative to the cloth, u_n and u_t its parts normal and "
          "tangential to the triangle. Absent: no air at all.");
  v.value({"velocity", "velocity of the air", "m/s"}, w.velocity, between(-1e3, 1e3));
  v.value({"air_density", "mass per volume rho of the air", "kg/m^3"}, w.air_density,
          above(0, 1e4));
  v.value({"normal_drag", "drag coefficient C_n for flow through the cloth"}, w.normal_drag,
          between(0, 1e3));
  v.value({"tangential_drag", "drag coefficient C_t for flow along the cloth"}, w.tangential_drag,
          between(0, 1e3));
  v.value({"gust_amplitude",
           "strength a of gusts: at time t the air moves "
           "with velocity * (1 + a sin(2 pi t / "
           "gust_period))"},
          w.gust_amplitude, between(0, 100));
  v.value({"gust_period", "time between gusts", "s"}, w.gust_period, above(0, 1e6));
}

template <class V>
void fields(V& v, Camera& c) {
  v.about("Camera",
          "Point of view of the pictures. Without position it frames "
          "all frames itself.");
  v.value({"position", "eye; absent: chosen from azimuth and elevation", "m"}, c.position,
          kLengths);
  v.value({"target", "point in the middle of the picture; absent: the middle of the cloths", "m"},
          c.target, kLengths);
  v.value({"fov", "vertical field of view", "degrees"}, c.fov, between(1, 170));
  v.value({"azimuth", "direction of the eye about y, for automatic framing", "degrees"}, c.azimuth,
          between(-360, 360));
  v.value({"elevation", "height of the eye above the horizon, for automatic framing", "degrees"},
          c.elevation, between(-90, 90));
  v.value({"ground", "height of the ground plane; absent: below the cloths", "m"}, c.ground,
          kLengths);
}

template <class V>
void fields(V& v, Render& r) {
  v.about("Render", "What the pictures show.");
  v.choice({"color", "colour of the triangles"}, r.color,
           {{"domain", "one colour per domain"},
            {"dof", "domains pale, shared vertices as dots: duplicates and corners"},
            {"strain", "largest principal strain, with a colour bar"},
            {"contact", "pressure of contact, with a colour bar; only where things can touch"},
            {"shaded", "one colour, lit"}});
  v.value({"size", "width and height", "pixels"}, r.size, between(16, 8192));
  v.value({"borders", "dark lines between domains"}, r.borders);
  v.value({"mesh_lines", "thin lines along all edges"}, r.mesh_lines);
}

inline const Choices& quantities() {
  static const Choices choices = {
      {"lowest_y", "lowest height of a vertex, m"},
      {"highest_y", "greatest height of a vertex, m"},
      {"center_x", "centre of mass, x, m"},
      {"center_y", "centre of mass, y, m"},
      {"center_z", "centre of mass, z, m"},
      {"vertex_x", "x of the vertex, m"},
      {"vertex_y", "y of the vertex, m"},
      {"vertex_z", "z of the vertex, m"},
      {"max_strain", "largest |sigma - 1| over the triangles, sigma a principal stretch"},
      {"mean_strain", "mean over the triangles of the largest |sigma - 1|"},
      {"kinetic_energy", "kinetic energy, J"},
      {"max_speed", "largest speed of a vertex, m/s"},
      {"momentum_x", "linear momentum, x, kg m/s"},
      {"momentum_y", "linear momentum, y, kg m/s"},
      {"momentum_z", "linear momentum, z, kg m/s"},
      {"reaction_force_y", "total force of the pins on the cloth, y, N"},
      {"seam_gap", "largest distance of a sewn vertex from its place on the seam, m"},
      {"sewn_vertices", "vertices that follow others because of a seam"},
      {"gradient",
       "largest over the steps so far: rms nodal force residual "
       "over free vertices / "
       "mean nodal weight"},
      {"iterations", "mean iterations per step so far"},
      {"converged_steps", "fraction of the steps so far that met the stop rule"}};
  return choices;
}

template <class V>
void fields(V& v, Expectation& e) {
  v.about("Expectation", "What must be true of the run: min <= quantity <= max at a time.");
  v.choice(Key{"quantity", "what is measured"}.needed(), e.quantity, quantities());
  v.value({"at", "time; absent: the end of the run", "s"}, e.at, kTimes);
  v.value(Key{"vertex", "vertex number, in the order of the mesh's file"}.only(
              e.quantity.starts_with("vertex_"), "a vertex_* quantity"),
          e.vertex, indices());
  const bool of_run =
      e.quantity == "gradient" || e.quantity == "iterations" || e.quantity == "converged_steps";
  v.value(Key{"cloth", "name of the cloth that is measured; absent: all together"}.only(
              !of_run, "a quantity other than gradient, iterations, converged_steps"),
          e.cloth, not_empty());
  v.value({"min", "lower bound, in the unit of the quantity"}, e.min);
  v.value({"max", "upper bound, in the unit of the quantity"}, e.max);
  v.at_least_one({"min", "max"});
}

template <class V>
void fields(V& v, Scene& s) {
  v.about("Scene", "The whole file.");
  v.value({"name", "name in reports; absent: the file's name without .json"}, s.name, not_empty());
  v.value({"description", "one sentence for people"}, s.description);
  v.object({"step", "time stepping"}, s.step);
  v.value(Key{"gravity", "acceleration of free fall; null: off", "m/s^2"}.on(), s.gravity,
          between(-1e6, 1e6));
  v.object({"wind", "moving air; absent: off"}, s.wind);
  v.value(
      {"damping", "rate d at which velocities decay, by exp(-d h) per step; absent: off", "1/s"},
      s.damping, above(0, 1e6));
  v.value({"self_collision", "cloth touches cloth, its own included"}, s.self_collision);
  v.value({"friction", "coefficient of dry friction between what touches; absent: none"},
          s.friction, above(0, 100));
  v.value({"kinetic_friction",
           "coefficient of friction of what slides, at most `friction`; absent: `friction`"},
          s.kinetic_friction, between(0, 100));
  v.object({"contact", "how things touch"}, s.contact);
  v.object({"solver", "how a step is solved"}, s.solver);
  v.object({"quality", "how accurately a step is solved"}, s.quality);
  v.map(Key{"materials", "materials by name; cloths share them"}.needed(), s.materials);
  v.list(Key{"cloths", "pieces of cloth, at least one"}.needed(), s.cloths);
  v.list({"seams", "what is sewn together"}, s.seams);
  v.list({"colliders", "bodies that the cloths collide with"}, s.colliders);
  v.object({"camera", "point of view"}, s.camera);
  v.object({"render", "what the pictures show"}, s.render);
  v.list({"expect",
          "what must be true of the run; piecework run reports each "
          "and the tests check "
          "those of the shipped scenes"},
         s.expect);
}

}  // namespace piecework::scene
