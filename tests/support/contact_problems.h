// Contact problems made by hand: points on a body with six rigid degrees of freedom and some modes.
#pragma once

#include <Eigen/Dense>
#include <random>
#include <vector>

namespace limber::testing {

/// b + A f are the contacts' speeds under impulses f: A = G Gᵀ, G = J M^{−½}, b = G y for a random motion y.
struct ContactSample {
  int contacts = 0, dimension = 0;
  std::vector<double> G = {}, A = {}, b = {};  ///< row-major
};

enum class Touching {
  kPlane,      ///< on one plane: rank 3 from the rigid motions
  kAround,     ///< from all sides
  kDuplicates  ///< every point twice
};

inline ContactSample sample_of(const Eigen::MatrixXd& G, const Eigen::VectorXd& b) {
  using RowMajor = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
  ContactSample sample{.contacts = static_cast<int>(G.rows()), .dimension = static_cast<int>(G.cols())};
  const RowMajor rows = G;
  RowMajor A = G * G.transpose();
  A = (0.5 * (A + A.transpose())).eval();
  sample.G.assign(rows.data(), rows.data() + rows.size());
  sample.A.assign(A.data(), A.data() + A.size());
  sample.b.assign(b.data(), b.data() + b.size());
  return sample;
}

/// Points on a unit box of 1 kg with `modes` modes of falling size; about half of the points approach.
inline ContactSample make_contacts(int contacts, int modes, Touching touching, std::mt19937& random) {
  std::normal_distribution<double> normal;
  std::uniform_real_distribution<double> uniform(-1.0, 1.0);
  Eigen::MatrixXd G(contacts, 6 + modes);
  for (int i = 0; i < contacts; ++i) {
    if (touching == Touching::kDuplicates && i >= (contacts + 1) / 2) {
      G.row(i) = G.row(i - (contacts + 1) / 2);
      continue;
    }
    const Eigen::Vector3d p(uniform(random), uniform(random), touching == Touching::kPlane ? -0.5 : uniform(random));
    const Eigen::Vector3d n = touching == Touching::kPlane
                                  ? Eigen::Vector3d(0, 0, 1)
                                  : Eigen::Vector3d(normal(random), normal(random), normal(random)).normalized();
    G.row(i).head<3>() = n;
    G.row(i).segment<3>(3) = std::sqrt(6.0) * p.cross(n);
    for (int k = 0; k < modes; ++k)  // a wave along each axis in turn, some cycles over the body
      G(i, 6 + k) = 2.0 * std::sin((1 + k / 6) * 2.0 * p[k % 3] + k) * n[(k / 3) % 3] / (1.0 + 0.1 * k);
  }
  Eigen::VectorXd y(6 + modes);
  for (int i = 0; i < y.size(); ++i) y[i] = normal(random) * (i < 6 ? 1.0 : 0.3);
  y[2] -= 1.0;
  return sample_of(G, G * y);
}

/// Contacts with friction, three rows each (normal, two tangents): the rows of G over all bodies' columns.
struct FrictionSample {
  int contacts = 0, columns = 0;
  std::vector<double> G = {}, b = {};  ///< row-major
};

/// An orthonormal frame (n, t₁, t₂) as rows.
inline Eigen::Matrix3d contact_frame(const Eigen::Vector3d& n) {
  Eigen::Matrix3d frame;
  frame.row(0) = n;
  frame.row(1) = n.unitOrthogonal();
  frame.row(2) = n.cross(Eigen::Vector3d(frame.row(1)));
  return frame;
}

/// Points all over a unit box of 1 kg with `modes` modes.
inline FrictionSample make_friction(int contacts, int modes, std::mt19937& random) {
  std::normal_distribution<double> normal;
  std::uniform_real_distribution<double> uniform(-1.0, 1.0);
  Eigen::MatrixXd G(3 * contacts, 6 + modes);
  for (int i = 0; i < contacts; ++i) {
    const Eigen::Vector3d p(uniform(random), uniform(random), uniform(random));
    const Eigen::Matrix3d frame =
        contact_frame(Eigen::Vector3d(normal(random), normal(random), 1.0 + std::abs(normal(random))).normalized());
    for (int c = 0; c < 3; ++c) {
      const Eigen::Vector3d axis = frame.row(c);
      G.row(3 * i + c).head<3>() = axis;
      G.row(3 * i + c).segment<3>(3) = std::sqrt(6.0) * p.cross(axis);
      for (int k = 0; k < modes; ++k)
        G(3 * i + c, 6 + k) = std::sin((1 + k / 6) * 2.0 * p[k % 3] + k) * axis[(k / 3) % 3] / (1.0 + 0.1 * k);
    }
  }
  Eigen::VectorXd y(6 + modes);
  for (int i = 0; i < y.size(); ++i) y[i] = normal(random) * (i < 6 ? 1.0 : 0.3);
  y[2] -= 1.0;
  ContactSample rows = sample_of(G, G * y);
  return {.contacts = contacts, .columns = rows.dimension, .G = std::move(rows.G), .b = std::move(rows.b)};
}

}  // namespace limber::testing
