#pragma once

// What does not move freely: pins, and all vertices of obstacles.

#include <cstddef>
#include <vector>

namespace piecework::contact {

/// Of vertices under the numbering of collision::Surface: cloth, then obstacles.
struct Held {
  int num_cloth = 0;
  const std::vector<char>* fixed = nullptr;  ///< per vertex of cloth

  [[nodiscard]] bool operator()(int v) const {
    return v >= num_cloth || (*fixed)[static_cast<std::size_t>(v)] != 0;
  }
};

}  // namespace piecework::contact
