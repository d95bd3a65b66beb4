// The loops of box_kernels.hpp over the operations `Lanes` of one instruction set. Included by
// box_kernels_*.cpp inside the namespace, after the definition of those operations. Nothing of the
// standard library is used here: the linker might keep its copy for all.

namespace {

template <class Lanes>
struct BoxLoops {
  /// Bounds of the eight elements of a leaf, and of the leaf itself.
  struct Bounds {
    BoxLanes outer, inner;
    float leaf[kNumbers];
  };

  static Bounds bounds_of(const Block& own, int leaf, const Reach& reach, bool ordered) {
    Bounds b;
    const BoxLanes& boxes = own.elements[leaf];
    for (int k = 0; k < 3; ++k) {
      for (int i = 0; i < kLanes; ++i) {
        b.outer.number[k][i] = reach.outer - boxes.number[3 + k][i];
        b.outer.number[3 + k][i] = reach.outer - boxes.number[k][i];
        b.inner.number[k][i] = reach.inner - boxes.number[3 + k][i];
        b.inner.number[3 + k][i] = reach.inner - boxes.number[k][i];
      }
      b.leaf[k] = reach.outer - own.leaves.number[3 + k][leaf];
      b.leaf[3 + k] = reach.outer - own.leaves.number[k][leaf];
    }
    constexpr int last = kNumbers - 1;
    b.leaf[last] = -__builtin_inff();
    for (int i = 0; i < kLanes; ++i) {
      const float bound = ordered ? -static_cast<float>(own.items[leaf].id[i]) : 0;
      b.outer.number[last][i] = b.inner.number[last][i] = bound;
      if (bound > b.leaf[last]) b.leaf[last] = bound;
    }
    return b;
  }

  /// Of the lanes in `hits`, those that belong into the result for element `lane` of `own`.
  template <int kOwn, int kOther>
  static unsigned without_neighbours(unsigned hits, const LeafItems& own, int lane,
                                     const LeafItems& others) {
    for (int i = 0; i < kOwn; ++i)
      for (int j = 0; j < kOther; ++j) hits &= ~Lanes::equal(others.vertex[j], own.vertex[i][lane]);
    return hits;
  }

  static unsigned decided(unsigned doubtful, unsigned hits, const Retest& retest, int id,
                          const LeafItems& others) {
    for (; doubtful != 0; doubtful &= doubtful - 1) {
      const int lane = __builtin_ctz(doubtful);
      if (!retest.near(retest.context, id, others.id[lane])) hits &= ~(1U << lane);
    }
    return hits;
  }

  template <int kOwn, int kOther, bool kOrdered>
  static std::size_t meet(const LeafQuery& query, const Reach& reach, const Retest& retest,
                          Hits& hits) {
    const Bounds bounds = bounds_of(*query.own, query.leaf, reach, kOrdered);
    const LeafItems& own = query.own->items[query.leaf];
    std::size_t compared = 0;
    for (int n = 0; n < query.count; ++n) {
      const Block& block = query.blocks[query.near[n]];
      ++compared;
      for (unsigned leaves = Lanes::below(block.leaves, bounds.leaf, 1); leaves != 0;
           leaves &= leaves - 1) {
        const int leaf = __builtin_ctz(leaves);
        const BoxLanes& boxes = block.elements[leaf];
        const LeafItems& others = block.items[leaf];
        ++compared;
        for (unsigned lanes = Lanes::above(&block.leaves.number[0][leaf], bounds.outer); lanes != 0;
             lanes &= lanes - 1) {
          const int lane = __builtin_ctz(lanes);
          unsigned found = Lanes::below(boxes, &bounds.outer.number[0][lane], kLanes);
          ++compared;
          if (kOrdered) found &= Lanes::greater(others.id, own.id[lane]);
          if (found == 0) continue;
          found = without_neighbours<kOwn, kOther>(found, own, lane, others);
          if (found == 0) continue;
          const unsigned doubtful =
              found & ~Lanes::below(boxes, &bounds.inner.number[0][lane], kLanes);
          if (doubtful != 0) found = decided(doubtful, found, retest, own.id[lane], others);
          hits.count[lane] += Lanes::append(hits.list[lane] + hits.count[lane], others.id, found);
        }
      }
    }
    return compared * kLanes;
  }

  /// A number's place is how many are smaller.
  static void sort(int* list, int count, int* sorted) {
    for (int i = 0; i < kLanes; ++i) list[count + i] = LeafItems::kNoElement;
    const int padded = (count + kLanes - 1) / kLanes * kLanes;
    for (int i = 0; i < count; ++i) {
      int place = 0;
      for (int j = 0; j < padded; ++j) place += list[j] < list[i] ? 1 : 0;
      sorted[place] = list[i];
    }
  }

  static constexpr BoxKernels table() { return {meet<1, 3, false>, meet<2, 2, true>, sort}; }
};

}  // namespace
