#pragma once

// Private to the module: the keys of cloths, what they are made of and how they are held and sewn,
// a part of the table in scene_fields.hpp.

#include <piecework/scene/body_fields.hpp>
#include <piecework/scene/scene.hpp>
#include <piecework/scene/scene_keys.hpp>

namespace piecework::scene {

template <class V>
void fields(V& v, Material& m) {
  v.about("Material",
          "What a cloth is made of. The membrane stiffness is k_s "
          "= stretching * thickness (N/m): "
          "with the default thickness of 1 m, stretching is k_s "
          "itself, as in the paper's tables.");
  v.value({"density", "mass per area", "kg/m^2"}, m.density, above(0, 1e6));
  v.value({"stretching", "Young's modulus Y of the membrane", "Pa"}, m.stretching, above(0, 1e15));
  v.value({"thickness", "thickness t; scales stretching only", "m"}, m.thickness, above(0, 1e3));
  v.value({"bending",
           "flexural rigidity D = Y t^3 / (12 (1 - nu^2)), not derived from "
           "thickness; hinges have "
           "the weight D / (A0 + A1), A0 and A1 the areas of the two "
           "triangles; absent: no bending",
           "N m"},
          m.bending, above(0, 1e12));
}

template <class V>
void fields(V& v, Region& r) {
  v.about("Region",
          "Vertices of a cloth: all that any of these keys names. "
          "Positions are those of the start "
          "shape, after scale, rotate and translate.");
  v.value({"vertices", "vertex numbers from 0, in the order of the mesh's file"}, r.vertices,
          indices());
  v.value({"sets",
           "named sets: border (every mesh); corners, left, right, bottom, top "
           "(sheet, strip); "
           "bottom, top (tube); center (disc); and the groups of a file"},
          r.sets, not_empty());
  v.value({"box", "[[x, y, z], [x, y, z]]: lowest and highest corner of a box", "m"}, r.box,
          kLengths);
  v.value({"sphere", "[x, y, z, radius] of a ball", "m"}, r.sphere, kLengths);
  v.at_least_one({"vertices", "sets", "box", "sphere"});
}

template <class V>
void fields(V& v, Pin& p) {
  v.about("Pin",
          "Vertices that are held, or moved by script: from start to "
          "stop they turn about an axis "
          "and are carried along a velocity (the rotation acts first), "
          "before and after they stand "
          "still; after release they are free.");
  v.object(Key{"region", "vertices to hold"}.needed(), p.region);
  v.value({"velocity", "velocity of the motion", "m/s"}, p.velocity, between(-1e4, 1e4));
  v.value({"axis", "direction of the axis of rotation, of any length but 0"}, p.axis, kLengths);
  v.value({"center", "a point on the axis of rotation", "m"}, p.center, kLengths);
  v.value({"rate", "angular velocity about the axis", "rad/s"}, p.rate, between(-1e4, 1e4));
  v.value({"start", "time at which the motion begins", "s"}, p.start, kTimes);
  v.value({"stop", "time at which the motion ends; absent: never", "s"}, p.stop, kTimes);
  v.value({"release", "time at which the vertices become free; absent: never", "s"}, p.release,
          kTimes);
}

template <class V>
void fields(V& v, Load& l) {
  v.about("Load", "A force that acts on some vertices for a while.");
  v.object(Key{"region", "vertices it acts on"}.needed(), l.region);
  v.value(
      Key{"force", "total force, shared by the vertices in proportion to their mass", "N"}.needed(),
      l.force, between(-1e9, 1e9));
  v.value({"start", "time at which it begins", "s"}, l.start, kTimes);
  v.value({"stop", "time at which it ends; absent: never", "s"}, l.stop, kTimes);
}

template <class V>
void fields(V& v, Cloth& c) {
  v.about("Cloth",
          "One piece of cloth. Its start shape is the mesh scaled, "
          "then rotated, then translated; "
          "its rest shape is what it is unstrained.");
  v.value({"name", "unique among the cloths"}, c.name, not_empty());
  v.object(Key{"mesh", "triangles"}.needed(), c.mesh);
  v.value(Key{"material", "name of an entry of materials"}.needed(), c.material, not_empty());
  v.choice({"rest", "rest shape"}, c.rest,
           {{"self", "the mesh as it was made or read, before scale"},
            {"uv", "flat: the texture coordinates of the mesh, in metres"},
            {"file", "positions from rest_file"}});
  v.value(Key{"rest_file",
              "mesh file of the same topology; a relative name "
              "starts at the folder of the scene"}
              .only(c.rest == "file", "\"rest\": \"file\""),
          c.rest_file, not_empty());
  v.value({"translate", "shift of the start shape", "m"}, c.translate, kLengths);
  v.value({"rotate", "rotation of the start shape about x, then y, then z", "degrees"}, c.rotate,
          between(-3600, 3600));
  v.value({"scale", "factors along x, y and z of the start shape, not of the rest shape"}, c.scale,
          above(0, 1e6));
  v.value({"velocity", "velocity at the start", "m/s"}, c.velocity, between(-1e4, 1e4));
  v.list({"pins", "vertices that are held or moved"}, c.pins);
  v.list({"loads", "forces on some of the vertices"}, c.loads);
}

template <class V>
void fields(V& v, Seam& s) {
  v.about("Seam",
          "Sewing. A vertex that is sewn onto an edge, onto any of its points, follows it exactly: "
          "seams need not conform, and cost no stiffness. They have no bending stiffness either. "
          "The side with more vertices follows (the second, `to`, if equal). Vertices that "
          "coincide become one; a vertex may be sewn onto one edge only. A pin on a sewn vertex "
          "holds the vertices that it follows.");
  v.value({"name", "for messages"}, s.name, not_empty());
  v.value({"cloth", "name of the cloth that is sewn; absent: the only one"}, s.cloth, not_empty());
  v.value({"to", "name of the cloth that it is sewn to; absent: itself"}, s.to, not_empty());
  v.value({"stitches",
           "list of [vertex, a, b, r], vertex of cloth, a and b of to, numbers from 0 in the order "
           "of the mesh's file: x_vertex = (1 - r) x_a + r x_b with r from 0 to 1"},
          s.stitches, indices());
  v.value({"chain",
           "vertices of cloth along a border, in order, each joined to the next by an edge; a "
           "closed chain ends with its first"},
          s.chain, indices());
  v.value(Key{"to_chain",
              "vertices of to, first to first and last to last, by fraction of the length at rest: "
              "the longer side is gathered"}
              .only(!s.chain.empty(), "chain"),
          s.to_chain, indices());
  v.value({"set",
           "name of a vertex set of cloth that runs along a border; it starts at the end with the "
           "lower number"},
          s.set, not_empty());
  v.value(Key{"to_set", "the same for to"}.only(!s.set.empty(), "set"), s.to_set, not_empty());
  v.value(Key{"reversed", "the first vertex of set meets the last one of to_set"}.only(
              !s.set.empty(), "set"),
          s.reversed);
  v.value({"file",
           "JSON file with chains (seams: a.verts, b.verts) or stitches (seam_stitches: lists of "
           "[vertex, a, b, r]) of cloth's mesh; a relative name starts at the folder of the scene"},
          s.file, not_empty());
  v.value({"distance",
           "border vertices within this distance of a border edge of to, in the start shape, are "
           "sewn onto it, unless they are already; at most an edge length",
           "m"},
          s.distance, above(0, 1e6));
  v.exactly_one({"stitches", "chain", "set", "file", "distance"});
  v.value({"close_time",
           "time in which an open seam closes; absent: it is closed from the start, and may be "
           "open by half a mean edge length there",
           "s"},
          s.close_time, above(0, 1e9));
}

}  // namespace piecework::scene
