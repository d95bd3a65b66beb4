// The loops of box_kernels.hpp over the operations `Lanes` of one instruction set. Included by
// box_kernels_*.cpp inside the namespace, after the definition of those operations. Nothing of the
// standard library is used here: the linker might keep its copy for all.

namespace {

template <class Lanes>
struct BoxLoops {
  /// Bounds of the elements of a leaf, and of the leaf itself.
  struct Bounds {
    BoxLanes outer, inner;
    short leaf[kNumbers];
  };

  static short bound(int reach, short number) {
    const int sum = reach - number;
    if (number == kEmptyNumber || sum < kEmptyBound) return kEmptyBound;
    return static_cast<short>(sum < kMostNumber ? sum : kMostNumber);
  }

  static Bounds bounds_of(const Block& own, int leaf, const Reach& reach) {
    Bounds b;
    const BoxLanes& boxes = own.elements[leaf];
    for (int k = 0; k < 6; ++k) {
      const int opposite = (k + 3) % 6;
      for (int i = 0; i < kLanes; ++i) {
        b.outer.number[k][i] = bound(reach.outer, boxes.number[opposite][i]);
        b.inner.number[k][i] = bound(reach.inner, boxes.number[opposite][i]);
      }
      b.leaf[k] = bound(reach.outer, own.leaves.number[opposite][leaf]);
    }
    constexpr int last = kNumbers - 1;
    b.leaf[last] = kEmptyBound;
    for (int i = 0; i < kLanes; ++i) {
      const short rank = boxes.number[last][i];  // -last, and an element is its own last
      b.outer.number[last][i] = b.inner.number[last][i] = rank;
      if (rank != kEmptyNumber && rank > b.leaf[last]) b.leaf[last] = rank;
    }
    return b;
  }

  /// Of the lanes in `hits`, those that belong into the result for element `lane` of `own`.
  template <int kOwn, int kOther>
  static unsigned without_neighbours(unsigned hits, const LeafItems& own, unsigned lane,
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

  /// Comparisons to be made: (block * kLanes + leaf) * kLanes + lane, block by its place in `near`.
  /// They go through queues, stage by stage, so that no branch depends on what they give: such
  /// branches cost more than the comparisons (measured: a third of the search).
  struct Queue {
    static constexpr int kFull = 1024;
    int entry[kFull + kLanes];
    int size = 0;

    [[nodiscard]] bool has_room_for_block() const { return size <= kFull - kBlockSize; }
  };

  struct Place {
    unsigned n, leaf, lane;
  };
  static Place place_of(int entry) {
    const auto e = static_cast<unsigned>(entry);
    return {e / kBlockSize, e / kLanes % kLanes, e % kLanes};
  }

  /// Queues the lanes of the leaf that reach leaf `other` of a block, the n-th in `near`.
  static void queue_lanes(const Bounds& bounds, const Block& block, int n, int other,
                          Queue& queue) {
    const unsigned lanes = Lanes::above(&block.leaves.number[0][other], bounds.outer);
    int entries[kLanes];
    for (int i = 0; i < kLanes; ++i) entries[i] = (n * kLanes + other) * kLanes + i;
    queue.size += Lanes::append(queue.entry + queue.size, entries, lanes);
  }

  template <int kOwn, int kOther, bool kOrdered>
  static void work_off(const LeafQuery& query, const Bounds& bounds, const Retest& retest,
                       Queue& queue, Hits& hits) {
    unsigned found[Queue::kFull];
    int left = 0;
    for (int i = 0; i < queue.size; ++i) {
      const Place p = place_of(queue.entry[i]);
      found[left] = Lanes::below(query.blocks[query.near[p.n]].elements[p.leaf],
                                 &bounds.outer.number[0][p.lane], kLanes);
      queue.entry[left] = queue.entry[i];
      left += found[left] != 0 ? 1 : 0;
    }
    const LeafItems& own = query.own->items[query.leaf];
    for (int i = 0; i < left; ++i) {
      const Place p = place_of(queue.entry[i]);
      const Block& block = query.blocks[query.near[p.n]];
      const LeafItems& others = block.items[p.leaf];
      unsigned partners = found[i];
      if (kOrdered) partners &= Lanes::greater(others.id, own.id[p.lane]);
      partners = without_neighbours<kOwn, kOther>(partners, own, p.lane, others);
      const unsigned doubtful =
          partners & ~Lanes::below(block.elements[p.leaf], &bounds.inner.number[0][p.lane], kLanes);
      if (doubtful != 0) partners = decided(doubtful, partners, retest, own.id[p.lane], others);
      hits.count[p.lane] +=
          Lanes::append(hits.list[p.lane] + hits.count[p.lane], others.id, partners);
    }
    queue.size = 0;
  }

  template <int kOwn, int kOther, bool kOrdered>
  static std::size_t meet(const LeafQuery& query, const Reach& reach, const Retest& retest,
                          Hits& hits) {
    const Bounds bounds = bounds_of(*query.own, query.leaf, reach);
    Queue queue;
    std::size_t compared = 0;
    const auto work = [&] {
      compared += static_cast<std::size_t>(queue.size);
      work_off<kOwn, kOther, kOrdered>(query, bounds, retest, queue, hits);
    };
    for (int n = 0; n < query.count; ++n) {
      const Block& block = query.blocks[query.near[n]];
      if (!queue.has_room_for_block()) work();
      const unsigned leaves = Lanes::below(block.leaves, bounds.leaf, 1);
      compared += static_cast<std::size_t>(1 + __builtin_popcount(leaves));
      for (unsigned rest = leaves; rest != 0; rest &= rest - 1)
        queue_lanes(bounds, block, n, __builtin_ctz(rest), queue);
    }
    work();
    return compared * kLanes;
  }

  /// A number's place follows from how many are larger. Lanes beyond the list are masked, not
  /// filled: reading what was just written in pieces would stall.
  static void sort(const int* list, int count, int* sorted) {
    for (int i = 0; i < count; ++i) {
      int larger = 0;
      for (int j = 0; j < count; j += kLanes) {
        const unsigned valid = count - j >= kLanes ? ~0U : (1U << (count - j)) - 1;
        larger += __builtin_popcount(Lanes::greater(list + j, list[i]) & valid);
      }
      sorted[count - 1 - larger] = list[i];
    }
  }

  static constexpr BoxKernels table() { return {meet<1, 3, false>, meet<2, 2, true>, sort}; }
};

}  // namespace
