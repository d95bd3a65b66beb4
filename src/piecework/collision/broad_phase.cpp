#include <piecework/collision/broad_phase.hpp>

#include <algorithm>
#include <numeric>

#include <piecework/core/error.hpp>

namespace piecework::collision {
namespace {

VertexBox united(const VertexBox& a, const VertexBox& b) {
  return {a.low.cwiseMin(b.low), a.high.cwiseMax(b.high)};
}

bool near(const VertexBox& a, const VertexBox& b, double gap) {
  return (a.low - b.high).maxCoeff() <= gap && (b.low - a.high).maxCoeff() <= gap;
}

/// Boxes halved at the median of their longest side, leaf by leaf.
class BoxTree {
 public:
  void build(std::vector<int> items, const std::vector<VertexBox>& boxes) {
    items_ = std::move(items);
    nodes_.clear();
    if (!items_.empty()) split(0, items_.size(), boxes);
  }

  template <class Visit>
  void visit_near(const VertexBox& box, double gap, const std::vector<VertexBox>& boxes,
                  std::size_t& tests, const Visit& visit) const {
    for (std::size_t k = 0; k < nodes_.size();) {
      const Node& node = nodes_[k];
      ++tests;
      if (!near(node.box, box, gap)) {
        k = node.skip;
        continue;
      }
      if (node.skip == k + 1)
        for (std::size_t i = node.begin; i < node.end; ++i) {
          ++tests;
          if (near(boxes[static_cast<std::size_t>(items_[i])], box, gap)) visit(items_[i]);
        }
      ++k;
    }
  }

 private:
  static constexpr std::size_t kLeaf = 4;
  struct Node {
    VertexBox box;
    std::size_t begin, end;
    std::size_t skip;  ///< the next node that is not below this one
  };

  void split(std::size_t begin, std::size_t end, const std::vector<VertexBox>& boxes) {
    const auto box_of = [&](int item) -> const VertexBox& {
      return boxes[static_cast<std::size_t>(item)];
    };
    const std::size_t self = nodes_.size();
    VertexBox all = box_of(items_[begin]);
    for (std::size_t i = begin; i < end; ++i) all = united(all, box_of(items_[i]));
    nodes_.push_back({all, begin, end, 0});
    if (end - begin > kLeaf) {
      Eigen::Index axis = 0;
      (all.high - all.low).maxCoeff(&axis);
      const std::size_t middle = (begin + end) / 2;
      const auto at = [&](std::size_t i) {
        return items_.begin() + static_cast<std::ptrdiff_t>(i);
      };
      std::nth_element(at(begin), at(middle), at(end), [&](int a, int b) {
        return box_of(a).low[axis] + box_of(a).high[axis] <
               box_of(b).low[axis] + box_of(b).high[axis];
      });
      split(begin, middle, boxes);
      split(middle, end, boxes);
    }
    nodes_[self].skip = nodes_.size();
  }

  std::vector<int> items_;
  std::vector<Node> nodes_;
};

}  // namespace

struct BroadPhase::Impl {
  explicit Impl(Surface s) : surface(std::move(s)) {}

  template <class Elements>
  void unite(std::span<const VertexBox> boxes, const Elements& elements,
             std::vector<VertexBox>& result) {
    result.clear();
    for (const auto& element : elements) {
      VertexBox box = boxes[static_cast<std::size_t>(element[0])];
      for (const int v : element) box = united(box, boxes[static_cast<std::size_t>(v)]);
      result.push_back(box);
    }
  }

  [[nodiscard]] bool may_meet(int vertex_a, int vertex_b) const {
    const bool a = surface.is_cloth(vertex_a), b = surface.is_cloth(vertex_b);
    return a != b || (a && surface.self);
  }

  static std::vector<int> all(std::size_t count) {
    std::vector<int> items(count);
    std::iota(items.begin(), items.end(), 0);
    return items;
  }

  void find_vertex_triangle(std::span<const VertexBox> boxes, double gap) {
    for (int v = 0; v < surface.num_vertices; ++v) {
      triangle_tree.visit_near(
          boxes[static_cast<std::size_t>(v)], gap, triangle_boxes, report.box_tests, [&](int t) {
            const Triangle& corners = surface.triangles[static_cast<std::size_t>(t)];
            if (may_meet(v, corners[0]) &&
                std::find(corners.begin(), corners.end(), v) == corners.end())
              pairs.vertex_triangle.push_back({v, t});
          });
    }
    std::sort(pairs.vertex_triangle.begin(), pairs.vertex_triangle.end());
  }

  void find_edge_edge(double gap) {
    for (std::size_t e = 0; e < surface.edges.size(); ++e) {
      const auto [a, b] = surface.edges[e];
      edge_tree.visit_near(edge_boxes[e], gap, edge_boxes, report.box_tests,
                           [&, a = a, b = b](int f) {
                             const auto [c, d] = surface.edges[static_cast<std::size_t>(f)];
                             const bool shared = a == c || a == d || b == c || b == d;
                             if (static_cast<int>(e) < f && !shared && may_meet(a, c))
                               pairs.edge_edge.push_back({static_cast<int>(e), f});
                           });
    }
    std::sort(pairs.edge_edge.begin(), pairs.edge_edge.end());
  }

  Surface surface;
  CandidatePairs pairs;
  BroadPhaseReport report;
  std::vector<VertexBox> triangle_boxes, edge_boxes;
  BoxTree triangle_tree, edge_tree;
};

BroadPhase::BroadPhase(Surface surface) : impl_(std::make_unique<Impl>(std::move(surface))) {}
BroadPhase::~BroadPhase() = default;

const Surface& BroadPhase::surface() const { return impl_->surface; }
const BroadPhaseReport& BroadPhase::report() const { return impl_->report; }

const CandidatePairs& BroadPhase::find(std::span<const VertexBox> boxes, double gap) {
  Impl& self = *impl_;
  PIECEWORK_ASSERT(static_cast<int>(boxes.size()) == self.surface.num_vertices);
  self.pairs.vertex_triangle.clear();
  self.pairs.edge_edge.clear();
  self.report = {.rebuilt = true};
  self.unite(boxes, self.surface.triangles, self.triangle_boxes);
  self.unite(boxes, self.surface.edges, self.edge_boxes);
  self.triangle_tree.build(Impl::all(self.triangle_boxes.size()), self.triangle_boxes);
  self.edge_tree.build(Impl::all(self.edge_boxes.size()), self.edge_boxes);
  self.find_vertex_triangle(boxes, gap);
  self.find_edge_edge(gap);
  return self.pairs;
}

}  // namespace piecework::collision
