#pragma once

// Private to the module: the keys of meshes and colliders, a part of the table in scene_fields.hpp.

#include <algorithm>
#include <initializer_list>
#include <limits>

#include <piecework/scene/bodies.hpp>
#include <piecework/scene/scene_keys.hpp>

namespace piecework::scene {

inline const Choices& generators() {
  static const Choices choices = {{"sheet",
                                   "width x height in the xz plane, columns x rows vertices, "
                                   "first vertex at the origin, x "
                                   "fastest; sets corners, left (x = 0), right, bottom (z = 0), "
                                   "top, border"},
                                  {"strip", "a sheet meant to be long; the same keys and sets"},
                                  {"tube",
                                   "open cylinder around y: radius, height, columns around, rows "
                                   "along; sets bottom, "
                                   "top, border"},
                                  {"disc",
                                   "flat disc in the xz plane: radius, rows rings, columns around "
                                   "the rim; sets border, "
                                   "center"},
                                  {"quilt",
                                   "patches_x x patches_y sheets in width x height, each meshed "
                                   "in its own way, one "
                                   "group per patch"},
                                  {"icosphere",
                                   "closed, for colliders: ball about the origin: radius; rows "
                                   "parts of each edge of the icosahedron"},
                                  {"box",
                                   "closed, for colliders: width x height x depth (x, y, z), on "
                                   "y = 0, its middle above the origin; 8 vertices"},
                                  {"stairs",
                                   "closed, for colliders: rows steps that climb along +z from "
                                   "the origin, width x height x depth in all"},
                                  {"funnel",
                                   "closed, for colliders: a cone with walls around y, radius at "
                                   "its upper rim, height, columns around; on y = 0"},
                                  {"pot",
                                   "closed, for colliders: a pot with lid, handle and a spout "
                                   "towards +x, radius of its belly, columns around; on y = 0"}};
  return choices;
}

template <class V>
void fields(V& v, Mesh& m) {
  v.about("Mesh", "Triangles, made by a generator or read from a file: one of the two.");
  v.choice({"generator", "shape to make"}, m.generator, generators());
  v.value({"file",
           "mesh file (OBJ, PLY, STL, glTF); a relative name starts at "
           "the folder of the scene"},
          m.file, not_empty());
  v.exactly_one({"generator", "file"});
  const bool made = m.file.empty(), read = m.generator.empty();
  const char* if_made = "generator";
  const char* if_read = "file";
  v.value(
      Key{"width", "extent along x (sheet, strip, quilt, box, stairs)", "m"}.only(made, if_made),
      m.width, above(0, 1e6));
  v.value(
      Key{"height", "extent along z (sheet, strip, quilt) or y (tube, box, stairs, funnel)", "m"}
          .only(made, if_made),
      m.height, above(0, 1e6));
  v.value(Key{"depth", "extent along z", "m"}.only(m.generator == "box" || m.generator == "stairs",
                                                   "generator box, stairs"),
          m.depth, above(0, 1e6));
  v.value(Key{"radius", "radius (tube, disc, icosphere, funnel, pot)", "m"}.only(made, if_made),
          m.radius, above(0, 1e6));
  v.value(Key{"columns", "vertices along the width, or around (tube, disc, funnel, pot)"}.only(
              made, if_made),
          m.columns, between(2, 1e6));
  v.value(Key{"rows",
              "vertices along the height; rings (disc); parts of edges (icosphere); steps "
              "(stairs)"}
              .only(made, if_made),
          m.rows, between(1, 1e6));
  v.choice(Key{"pattern", "triangulation (sheet, strip)"}.only(made, if_made), m.pattern,
           {{"alternating", "diagonals alternate from cell to cell"},
            {"one_diagonal", "all diagonals one way: stiffness depends on direction"},
            {"delaunay",
             "jittered grid, edges flipped until Delaunay: no "
             "preferred direction"}});
  v.value(Key{"jitter", "how far inner vertices of the delaunay pattern move, in cells"}.only(
              made, if_made),
          m.jitter, between(0, 0.45));
  v.value(Key{"seed", "seed of the jitter"}.only(made, if_made), m.seed,
          between(0, std::numeric_limits<int>::max()));
  v.value(Key{"patches_x", "patches along the width (quilt)"}.only(made, if_made), m.patches_x,
          between(1, 1000));
  v.value(Key{"patches_y", "patches along the height (quilt)"}.only(made, if_made), m.patches_y,
          between(1, 1000));
  v.value(Key{"units", "what one unit of the file measures", "m"}.only(read, if_read), m.units,
          above(0, 1e6));
  v.choice(Key{"up_axis", "axis that points up in the file; it becomes y"}.only(read, if_read),
           m.up_axis, {{"x", "x is up"}, {"y", "y is up"}, {"z", "z is up"}});
  v.value(Key{"repair",
              "mend what can be mended safely (zero-area and duplicate "
              "triangles, isolated vertices, "
              "orientation), with a note; false: such a mesh is an error"}
              .only(read, if_read),
          m.repair);
  v.value(Key{"weld", "merge vertices of one group at the same position"}.only(read, if_read),
          m.weld);
}

template <class V>
void fields(V& v, Motion& m) {
  v.about("Motion",
          "Rigid motion of a collider: from start to stop it turns about an axis and is carried "
          "along a velocity (the rotation acts first); before and after it stands still.");
  v.value({"velocity", "velocity of the motion", "m/s"}, m.velocity, between(-1e4, 1e4));
  v.value({"axis", "direction of the axis of rotation, of any length but 0"}, m.axis, kLengths);
  v.value({"center", "a point on the axis of rotation", "m"}, m.center, kLengths);
  v.value({"rate", "angular velocity about the axis", "rad/s"}, m.rate, between(-1e4, 1e4));
  v.value({"start", "time at which the motion begins", "s"}, m.start, kTimes);
  v.value({"stop", "time at which the motion ends; absent: never", "s"}, m.stop, kTimes);
}

template <class V>
void fields(V& v, Sequence& s) {
  v.about("Sequence",
          "A body that changes its shape: mesh files of the same vertices and faces, one per "
          "frame. In between vertices move along straight lines; before the first frame and after "
          "the last one they stand still.");
  v.value(Key{"pattern",
              "name of the files, the frame's number in braces: frame_{:04}.obj is frame_0001.obj "
              "for frame 1, frame_{}.obj is frame_1.obj; a relative name starts at the folder of "
              "the scene"}
              .needed(),
          s.pattern, not_empty());
  v.value({"first", "number of the first frame"}, s.first, between(0, 1e6));
  v.value(Key{"last", "number of the last frame"}.needed(), s.last, between(0, 1e6));
  v.value({"fps", "frames per second", "1/s"}, s.fps, above(0, 1e6));
  v.value({"start", "time of the first frame", "s"}, s.start, kTimes);
  v.value({"units", "what one unit of the files measures", "m"}, s.units, above(0, 1e6));
  v.choice({"up_axis", "axis that points up in the files; it becomes y"}, s.up_axis,
           {{"x", "x is up"}, {"y", "y is up"}, {"z", "z is up"}});
}

template <class V>
void fields(V& v, Avatar& a) {
  v.about("Avatar",
          "An animated figure from a file: a skin on joints (linear blend skinning), rigid parts, "
          "or both.");
  v.value(Key{"file", "glTF, GLB or FBX file; a relative name starts at the folder of the scene"}
              .needed(),
          a.file, not_empty());
  v.value(
      {"clip", "name of the animation; absent: the only one; a figure without any stands still"},
      a.clip, not_empty());
  v.value({"start_time", "time of the clip at which the motion begins", "s"}, a.start_time, kTimes);
  v.value({"lead_in", "time before the motion begins, for garments to settle", "s"}, a.lead_in,
          kTimes);
  v.choice({"lead", "what the figure does during lead_in"}, a.lead,
           {{"bind_pose", "moves from the pose of the file without a clip to the first pose"},
            {"first_pose", "holds the first pose"}});
  v.value({"units", "what one unit of the file measures", "m"}, a.units, above(0, 1e6));
  v.choice({"up_axis", "axis that points up in the file; it becomes y"}, a.up_axis,
           {{"x", "x is up"}, {"y", "y is up"}, {"z", "z is up"}});
}

template <class V>
void fields(V& v, HalfSpace& h) {
  v.about("HalfSpace", "All that lies below a plane.");
  v.value({"point", "a point of the plane", "m"}, h.point, kLengths);
  v.value({"normal", "direction away from the solid, of any length but 0"}, h.normal, kLengths);
}

template <class V>
void fields(V& v, Collider& c) {
  v.about("Collider",
          "A body that cloth collides with; its motion is prescribed. It is placed by scale, "
          "rotate and translate, in this order; then it moves.");
  const auto is = [&](std::initializer_list<const char*> shapes) {
    return std::find(shapes.begin(), shapes.end(), c.shape) != shapes.end();
  };
  v.value({"name", "unique among the colliders"}, c.name, not_empty());
  v.choice(Key{"shape", "kind of body; all but mesh are exact solids"}.needed(), c.shape,
           {{"plane", "all that is below a plane"},
            {"sphere", "a ball"},
            {"capsule", "all within radius of the segment between from and to"},
            {"box", "edges along x, y and z before it is rotated"},
            {"cylinder", "solid, with flat ends in from and to"},
            {"half_spaces", "what is below all of several planes: a polyhedron, a corner, a slab"},
            {"mesh", "triangles: one of mesh, sequence and avatar"}});
  v.value(Key{"point", "a point of the plane", "m"}.only(is({"plane"}), "shape plane"), c.point,
          kLengths);
  v.value(Key{"normal", "direction away from the solid, of any length but 0"}.only(is({"plane"}),
                                                                                   "shape plane"),
          c.normal, kLengths);
  v.value(Key{"center", "its middle", "m"}.only(is({"sphere", "box"}), "shape sphere, box"),
          c.center, kLengths);
  v.value(Key{"radius", "its radius", "m"}.only(is({"sphere", "capsule", "cylinder"}),
                                                "shape sphere, capsule, cylinder"),
          c.radius, above(0, 1e6));
  v.value(Key{"from", "one end", "m"}.only(is({"capsule", "cylinder"}), "shape capsule, cylinder"),
          c.from, kLengths);
  v.value(
      Key{"to", "the other end", "m"}.only(is({"capsule", "cylinder"}), "shape capsule, cylinder"),
      c.to, kLengths);
  v.value(Key{"size", "extents along x, y and z", "m"}.only(is({"box"}), "shape box"), c.size,
          above(0, 1e6));
  v.value(Key{"rounding", "radius of its edges; its extents stay what they are", "m"}.only(
              is({"box", "cylinder", "half_spaces"}), "shape box, cylinder, half_spaces"),
          c.rounding, between(0, 1e6));
  v.list(Key{"planes", "planes below which the solid lies, 1 to 64"}.only(is({"half_spaces"}),
                                                                          "shape half_spaces"),
         c.planes);
  v.choice(
      Key{"surface", "what cloth meets"}.only(
          !is({"plane", "mesh"}),
          "a shape with a closed form and an end: sphere, capsule, box, cylinder, half_spaces"),
      c.surface,
      {{"exact",
        "the solid itself; only vertices of the cloth meet it, so coarse cloth can be cut by "
        "its edges, and it never waits for cloth"},
       {"triangles",
        "a closed mesh of it: edges meet edges, and a body that moves waits for cloth that "
        "cannot give way; dearer"}});
  v.value(
      Key{"segments", "chords of each quarter of a circle; rounded boxes have half as many"}.only(
          c.surface == "triangles", "surface triangles"),
      c.segments, between(1, 256));
  v.object(Key{"mesh", "triangles that keep their shape"}.only(is({"mesh"}), "shape mesh"), c.mesh);
  v.object(Key{"sequence", "triangles from a file per frame"}.only(is({"mesh"}), "shape mesh"),
           c.sequence);
  v.object(Key{"avatar", "triangles of an animated figure"}.only(is({"mesh"}), "shape mesh"),
           c.avatar);
  v.value({"translate", "shift", "m"}, c.translate, kLengths);
  v.value({"rotate", "rotation about x, then y, then z", "degrees"}, c.rotate,
          between(-3600, 3600));
  v.value(Key{"scale", "factors along x, y and z"}.only(is({"mesh"}), "shape mesh"), c.scale,
          above(0, 1e6));
  v.object({"motion", "rigid motion; absent: none"}, c.motion);
  v.value({"friction", "coefficient of friction; absent: that of the scene"}, c.friction,
          between(0, 10));
  v.value(
      {"kinetic_friction",
       "coefficient of friction of what slides, at most `friction`; absent: `friction`, or that "
       "of the scene if that is absent too"},
      c.kinetic_friction, between(0, 10));
  v.value({"thickness", "distance that cloth keeps from it; absent: that of the scene", "m"},
          c.thickness, above(0, 10));
}

}  // namespace piecework::scene
