// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>

#include <vector>

#include "btf/importers/ubo2014/header.h"

namespace veneer::btf::ubo2014 {

using Matrix = Eigen::Matrix<float, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

/// A matrix as it lies in a file, row by row, in numbers of 2, 4 or 8 bytes.
struct StoredMatrix {
  std::span<const std::byte> bytes;
  std::size_t scalar_size = 4;
  std::size_t columns = 0;

  [[nodiscard]] Matrix rows(std::size_t first, std::size_t count) const;
};

/// Two factors whose product holds some of the numbers of every texel, [view][light][3]: number
/// `first + stride * i + r` of texel t is row (t * texel_rows + r) of `per_texel` times row i of
/// `per_value`, plus the means of both rows where there are any.
struct Product {
  std::size_t first = 0;
  std::size_t stride = 1;
  std::size_t texel_rows = 1;
  StoredMatrix per_texel;
  Matrix per_value;
  StoredMatrix texel_mean;     ///< one column, or no bytes
  Eigen::VectorXf value_mean;  ///< or empty
};

/// How three decoded numbers stand for linear RGB.
struct Encoding {
  bool logarithm = false;  ///< the reduced dynamic range of FMF
  int colour_model = 0;    ///< numbered as in DFMF
  Eigen::Vector3f colour_mean = Eigen::Vector3f::Zero();
  Eigen::Matrix3f colour_matrix = Eigen::Matrix3f::Identity();

  [[nodiscard]] Eigen::Vector3f decode(const Eigen::Vector3f& value) const;
};

struct Factors {
  Encoding encoding;
  std::vector<Product> products;
};

/// Reads the body of a factorised file to its end. Errors: kBadFormat (other sizes than the header
/// demands, a colour model that is not known or not RGB).
[[nodiscard]] Result<Factors> read_factors(BinaryReader& reader, const Header& header);

}  // namespace veneer::btf::ubo2014
