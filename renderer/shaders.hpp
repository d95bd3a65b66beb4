#pragma once

// GLSL 3.30 sources, without the version line (GlProgram adds it).
//
// Colours leave every fragment shader as the square root of linear light: cheap to encode on a CPU
// rasteriser, and exact enough for resolve.hpp to average samples in linear light.

namespace piecework::render::shaders {

/// Cloth. Defines: BORDERS paints border segments, MESH_LINES the edges of the frame's triangles.
extern const char* const kClothVertex;
extern const char* const kClothFragment;

/// Ground: invisible but for the shadows on it, which fade with distance.
extern const char* const kGroundVertex;
extern const char* const kGroundFragment;

extern const char* const kBackgroundVertex;
extern const char* const kBackgroundFragment;

/// Dots: small shaded balls that always face the viewer, one instance each.
extern const char* const kDotVertex;
extern const char* const kDotFragment;

}  // namespace piecework::render::shaders
