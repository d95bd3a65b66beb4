#include <piecework/pd/contact_product.hpp>

#include <numeric>

#include <piecework/core/parallel.hpp>

namespace piecework::pd {
namespace {

std::size_t at(int i) { return static_cast<std::size_t>(i); }

Eigen::Vector4f padded(const Eigen::Vector3f& v) { return {v[0], v[1], v[2], 0}; }

}  // namespace

void ContactProduct::take(std::span<const model::ContactBlock> contacts,
                          const model::ClothModel& model, const model::Reduction& reduction) {
  contacts_.clear();
  terms_.clear();
  for (const model::ContactBlock& contact : contacts) {
    const auto first = static_cast<int>(terms_.size());
    for (std::size_t k = 0; k < at(contact.count); ++k)
      model.sewing.map().visit_carriers(contact.vertices[k], [&](int carrier, double weight) {
        const int unknown = reduction.number(carrier);
        if (unknown >= 0) terms_.push_back({unknown, static_cast<float>(weight * contact.beta[k])});
      });
    const Eigen::Matrix3f C = contact.stiffness.cast<float>();
    contacts_.push_back({{padded(C.col(0)), padded(C.col(1)), padded(C.col(2))}, first});
  }
  contacts_.push_back({{Row::Zero(), Row::Zero(), Row::Zero()}, static_cast<int>(terms_.size())});
  force_.resize(contacts.size());
  list_users(reduction.count());
}

void ContactProduct::list_users(int num_unknowns) {
  user_begin_.assign(at(num_unknowns) + 1, 0);
  for (const Term& term : terms_) ++user_begin_[at(term.index) + 1];
  touched_.clear();
  for (int i = 0; i < num_unknowns; ++i)
    if (user_begin_[at(i) + 1] > 0) touched_.push_back(i);
  std::partial_sum(user_begin_.begin(), user_begin_.end(), user_begin_.begin());
  users_.resize(terms_.size());
  std::vector<int> cursor(user_begin_.begin(), user_begin_.end() - 1);
  for (std::size_t c = 0; c + 1 < contacts_.size(); ++c)
    for (int t = contacts_[c].first_term; t < contacts_[c + 1].first_term; ++t)
      users_[at(cursor[at(terms_[at(t)].index)]++)] = {static_cast<int>(c), terms_[at(t)].beta};
}

void ContactProduct::add(const Positions& d, Positions& product) {
  moved_.resize(at(static_cast<int>(d.rows())));
  parallel_for(moved_.size(), [&](std::size_t i) {
    moved_[i] = padded(d.row(static_cast<Eigen::Index>(i)).transpose().cast<float>());
  });
  parallel_for(force_.size(), [&](std::size_t c) {
    Row relative = Row::Zero();
    for (int t = contacts_[c].first_term; t < contacts_[c + 1].first_term; ++t)
      relative += terms_[at(t)].beta * moved_[at(terms_[at(t)].index)];
    const auto& C = contacts_[c].stiffness;
    force_[c] = relative[0] * C[0] + relative[1] * C[1] + relative[2] * C[2];
  });
  parallel_for(touched_.size(), [&](std::size_t i) {
    const int unknown = touched_[i];
    Row sum = Row::Zero();
    for (int u = user_begin_[at(unknown)]; u < user_begin_[at(unknown) + 1]; ++u)
      sum += users_[at(u)].beta * force_[at(users_[at(u)].index)];
    product.row(unknown) += sum.head<3>().transpose().cast<double>();
  });
}

}  // namespace piecework::pd
