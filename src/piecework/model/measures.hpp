#pragma once

// What a state is like: strain, momentum, energy. For pictures, tables and expectations.

#include <vector>

#include <piecework/core/types.hpp>
#include <piecework/model/constraints.hpp>

namespace piecework::model {

/// Largest |sigma - 1| of each triangle's two principal stretches, dimensionless.
std::vector<float> triangle_strain(const ClothModel& model, const Positions& x);

/// sum m v, kg m/s.
Vec3 linear_momentum(const ClothModel& model, const Positions& v);

/// sum m x / sum m over vertices first ... first + count - 1, m.
Vec3 center_of_mass(const ClothModel& model, const Positions& x, int first, int count);

/// sum m v^2 / 2, J.
double kinetic_energy(const ClothModel& model, const Positions& v);

}  // namespace piecework::model
