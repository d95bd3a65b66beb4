#pragma once

// The second derivative of contact, to be multiplied with many vectors.

#include <array>
#include <span>
#include <vector>

#include <piecework/model/constraints.hpp>
#include <piecework/model/contact_terms.hpp>
#include <piecework/model/reduction.hpp>

namespace piecework::pd {

/// H_c = sum over contacts of B^T C B, where B u = sum_k beta_k u_k and C is 3 x 3, on the n_f
/// unknowns. Not assembled: with many contacts per vertex that would take more memory than what it
/// is made of. Same bits for every number of threads.
class ContactProduct {
 public:
  void take(std::span<const model::ContactBlock> contacts, const model::ClothModel& model,
            const model::Reduction& reduction);

  /// product += H_c d in 32 bits; both n_f x 3, m -> N.
  void add(const Positions& d, Positions& product);

 private:
  using Row = Eigen::Vector4f;  ///< the fourth is 0: one vector register

  struct Contact {
    std::array<Row, 3> stiffness;  ///< columns
    int first_term;
  };
  /// One beta of a contact: of an unknown in contacts_ order, of a contact in users_ order.
  struct Term {
    int index;
    float beta;
  };

  void list_users(int num_unknowns);

  std::vector<Contact> contacts_;  ///< and one behind the last
  std::vector<Term> terms_;        ///< contact by contact
  std::vector<int> user_begin_;    ///< per unknown, into users_
  std::vector<Term> users_;        ///< unknown by unknown
  std::vector<int> touched_;       ///< unknowns with users
  std::vector<Row> moved_;         ///< d, per unknown
  std::vector<Row> force_;         ///< per contact
};

}  // namespace piecework::pd
