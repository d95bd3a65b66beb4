#pragma once

// The scenes of bench_contact_steps.

#include <numbers>
#include <string>

#include <piecework/scene/scene.hpp>

namespace piecework::bench {

/// Scene B (scenes/drape_on_sphere.json) with side x side vertices.
/// \param tolerance  of steps, mean edge lengths; as text: it also names the row
scene::Scene drape_scene(int side, const std::string& tolerance);

inline constexpr double kSlope = 20 * std::numbers::pi / 180;  ///< of slope_scene()

/// A flat sheet of 0.4 m, 20 x 20 vertices, on a solid that slopes down to +x: gravity is turned,
/// the solid is level. \param mesh  the solid is a mesh, else a half-space
scene::Scene slope_scene(bool mesh, double friction);

/// How far what slides down the slope gets in `steps` implicit Euler steps of h s, m: Coulomb's
/// law, and no motion where it sticks. \param speed  at the start, m/s
double coulomb_distance(double speed, double friction, double h, int steps);

/// What a cloth lies on.
enum class Support { Rigid, Elastic };

/// Coefficients of friction with which the cloth of support_scene() stays where it is, and slides.
inline constexpr double kSticks = 0.6, kSlides = 0.1;

/// A cloth of side x side vertices, the scene's first, over a rod and longer on one side, or on a
/// sheet that slopes and is held all around.
scene::Scene support_scene(Support support, int side, double friction);

/// The same without what touches: no obstacles, cloth passes through cloth.
scene::Scene without_contact(scene::Scene scene);

}  // namespace piecework::bench
