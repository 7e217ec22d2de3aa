// SPDX-License-Identifier: Apache-2.0
#include "btf/importers/ubo2014/factors.h"

#include <cmath>

namespace veneer::btf::ubo2014 {
namespace {

constexpr float kEpsilon = 1e-5F;  // what was added before a logarithm was taken

// Sizes of one factorisation: U has rows, V columns.
struct Shape {
  std::size_t scalar_size = 0;
  std::uint64_t components = 0;
  std::uint64_t rows = 0;
  std::uint64_t columns = 0;
};

Result<std::size_t> read_scalar_size(BinaryReader& reader) {
  VENEER_ASSIGN(const auto size, reader.read<std::uint8_t>("the size of a number"));
  if (size != 2 && size != 4 && size != 8)
    return reader.damaged("its numbers have {} bytes; expected 2, 4 or 8", size);
  return std::size_t{size};
}

Result<std::uint64_t> read_count(BinaryReader& reader, std::string_view what) {
  VENEER_ASSIGN(const auto count, reader.read<std::uint32_t>(what));
  return std::uint64_t{count};
}

Result<StoredMatrix> read_matrix(BinaryReader& reader,
                                 std::size_t scalar_size,
                                 std::uint64_t rows,
                                 std::uint64_t columns,
                                 std::string_view what) {
  VENEER_ASSIGN(const auto bytes, reader.take({rows, columns, scalar_size}, what));
  return StoredMatrix{bytes, scalar_size, static_cast<std::size_t>(columns)};
}

// Singular values, which V holds already, then both factors of a whole matrix. Its rows are pairs
// (times `channels`) and its columns texels, or its rows texels and its columns pairs.
Result<Product> read_product(BinaryReader& reader,
                             const Header& header,
                             const Shape& shape,
                             std::uint64_t channels) {
  if (shape.components == 0) return reader.damaged("a factor has no components");
  const std::uint64_t pairs = header.pair_count();
  const std::uint64_t texels = header.texel_count();
  const bool upright = shape.rows == channels * pairs && shape.columns == texels;
  const bool turned = shape.rows == channels * texels && shape.columns == pairs;
  if (!upright && !turned)
    return reader.damaged("a matrix of {} x {} does not fit {} texels and {} pairs of directions",
                          shape.rows,
                          shape.columns,
                          texels,
                          pairs);
  VENEER_TRY(reader.take({shape.components, shape.scalar_size}, "the singular values"));
  VENEER_ASSIGN(
      const StoredMatrix u,
      read_matrix(reader, shape.scalar_size, shape.rows, shape.components, "the factor U"));
  VENEER_ASSIGN(
      const StoredMatrix v,
      read_matrix(reader, shape.scalar_size, shape.columns, shape.components, "the factor V"));
  Product product;
  product.stride = channels == 3 && upright ? 1 : 3;
  product.texel_rows = upright ? 1 : static_cast<std::size_t>(channels);
  product.per_texel = upright ? v : u;
  product.per_value = upright ? u.rows(0, static_cast<std::size_t>(shape.rows))
                              : v.rows(0, static_cast<std::size_t>(shape.columns));
  return product;
}

Result<Factors> read_full(BinaryReader& reader, const Header& header) {
  Factors factors;
  if (header.extended) {
    VENEER_ASSIGN(const auto version, reader.read<std::uint8_t>("the version of the extension"));
    if (version > 2) return reader.damaged("version {} of its extension is not known", version);
    if (version >= 1) {
      VENEER_ASSIGN(const auto method, read_count(reader, "the reduction of the dynamic range"));
      factors.encoding.logarithm = method != 0;
    }
    if (version >= 2) {
      VENEER_ASSIGN(const auto width, read_count(reader, "the height map's width"));
      VENEER_ASSIGN(const auto height, read_count(reader, "the height map's height"));
      VENEER_TRY(reader.take({width, height, 2}, "the height map"));
    }
  }
  Shape shape;
  VENEER_TRY(reader.take({sizeof(std::uint32_t)}, "the number of components"));
  VENEER_ASSIGN(shape.scalar_size, read_scalar_size(reader));
  VENEER_ASSIGN(shape.components, read_count(reader, "the number of components"));
  VENEER_ASSIGN(shape.rows, read_count(reader, "the rows of U"));
  VENEER_ASSIGN(shape.columns, read_count(reader, "the rows of V"));
  VENEER_ASSIGN(Product product, read_product(reader, header, shape, 3));
  factors.products.push_back(std::move(product));
  return factors;
}

Result<Factors> read_decorrelated(BinaryReader& reader, const Header& header) {
  Factors factors;
  Encoding& encoding = factors.encoding;
  VENEER_TRY(reader.take({sizeof(std::uint32_t)}, "the number of components"));
  VENEER_ASSIGN(encoding.colour_model, reader.read<std::int32_t>("the colour model"));
  switch (encoding.colour_model) {
    case 0:
    case 1:
    case 3:
    case 4:
    case 9:
    case 10:
    case 11:
    case 12:
      break;
    case 2:
      return reader.damaged(
          "its colours are CIE Lab without a white point; save it in another "
          "colour model");
    default:
      return reader.damaged("its colour model {} is spectral or not known", encoding.colour_model);
  }
  for (float& value : encoding.colour_mean) {
    VENEER_ASSIGN(value, reader.read<float>("the mean colour"));
  }
  for (Eigen::Index row = 0; row < 3; ++row) {
    for (Eigen::Index column = 0; column < 3; ++column) {
      VENEER_ASSIGN(encoding.colour_matrix(row, column), reader.read<float>("the colour matrix"));
    }
  }
  for (std::size_t channel = 0; channel < 3; ++channel) {
    Shape shape;
    VENEER_ASSIGN(shape.scalar_size, read_scalar_size(reader));
    VENEER_ASSIGN(shape.components, read_count(reader, "the number of components"));
    VENEER_ASSIGN(shape.rows, read_count(reader, "the rows of U"));
    VENEER_ASSIGN(shape.columns, read_count(reader, "the rows of V"));
    VENEER_ASSIGN(Product product, read_product(reader, header, shape, 1));
    product.first = channel;
    factors.products.push_back(std::move(product));
  }
  return factors;
}

Result<Factors> read_per_view(BinaryReader& reader, const Header& header) {
  Factors factors;
  VENEER_TRY(reader.take({sizeof(std::uint32_t)}, "the number of components"));
  VENEER_ASSIGN(const auto views, read_count(reader, "the number of factorised views"));
  if (views != header.views.size())
    return reader.damaged("it has {} views and factors for {}", header.views.size(), views);
  const std::uint64_t lights = header.lights.size();
  const std::uint64_t texels = header.texel_count();
  for (std::size_t view = 0; view < header.views.size(); ++view) {
    VENEER_ASSIGN(const std::size_t scalar_size, read_scalar_size(reader));
    VENEER_ASSIGN(const auto components, read_count(reader, "the number of components"));
    VENEER_ASSIGN(const auto weights, read_count(reader, "the number of weights"));
    VENEER_ASSIGN(const auto length, read_count(reader, "the length of a component"));
    const bool weights_of_texels = weights == texels && length == 3 * lights;
    const bool weights_of_lights = weights == lights && length == 3 * texels;
    if (!weights_of_texels && !weights_of_lights)
      return reader.damaged(
          "view {}: {} weights and components of {} numbers do not fit {} texels "
          "and {} lights",
          view,
          weights,
          length,
          texels,
          lights);
    VENEER_TRY(reader.take({components, scalar_size}, "the eigenvalues"));
    VENEER_ASSIGN(const StoredMatrix mean,
                  read_matrix(reader, scalar_size, length, 1, "a view's mean"));
    VENEER_ASSIGN(const StoredMatrix c,
                  read_matrix(reader, scalar_size, length, components, "a view's components"));
    VENEER_ASSIGN(const StoredMatrix w,
                  read_matrix(reader, scalar_size, weights, components, "a view's weights"));
    Product product;
    product.first = view * header.lights.size() * 3;
    if (weights_of_texels) {
      product.per_texel = w;
      product.per_value = c.rows(0, static_cast<std::size_t>(length));
      product.value_mean = mean.rows(0, static_cast<std::size_t>(length)).col(0);
    } else {
      product.stride = 3;
      product.texel_rows = 3;
      product.per_texel = c;
      product.per_value = w.rows(0, static_cast<std::size_t>(weights));
      product.texel_mean = mean;
    }
    factors.products.push_back(std::move(product));
  }
  return factors;
}

}  // namespace

Matrix StoredMatrix::rows(std::size_t first, std::size_t count) const {
  Matrix matrix(static_cast<Eigen::Index>(count), static_cast<Eigen::Index>(columns));
  const std::size_t begin = first * columns;
  for (std::size_t i = 0; i < count * columns; ++i) {
    float& value = matrix.data()[i];
    if (scalar_size == 2)
      value = static_cast<float>(number_at<Eigen::half>(bytes, begin + i));
    else if (scalar_size == 4)
      value = number_at<float>(bytes, begin + i);
    else
      value = static_cast<float>(number_at<double>(bytes, begin + i));
  }
  return matrix;
}

Eigen::Vector3f Encoding::decode(const Eigen::Vector3f& value) const {
  const auto rgb_from_yuv = [](float y, float u, float v) {
    return Eigen::Vector3f(y + 1.13983F * v, y - 0.39465F * u - 0.5806F * v, y + 2.03211F * u);
  };
  const auto antilog = [](float x) { return std::exp(x) - kEpsilon; };
  // The logarithm of a number that may be negative: its sign, and how often it is epsilon.
  const auto signed_antilog = [](float x) {
    return x == 0.0F ? 0.0F : std::copysign(std::exp(std::abs(x)) * kEpsilon, x);
  };
  Eigen::Vector3f rgb = value;
  if (logarithm) rgb = {antilog(rgb[0]), antilog(rgb[1]), antilog(rgb[2])};
  switch (colour_model) {
    case 1:
      return rgb_from_yuv(rgb[0], rgb[1], rgb[2]);
    case 3:
      return colour_matrix.transpose() * rgb + colour_mean;
    case 4:  // Y, Co, Cg
      return {rgb[0] + rgb[1] - rgb[2], rgb[0] + rgb[2], rgb[0] - rgb[1] - rgb[2]};
    case 9:
      return rgb_from_yuv(antilog(rgb[0]), rgb[1], rgb[2]);
    case 10:
      return rgb_from_yuv(antilog(rgb[0]), signed_antilog(rgb[1]), signed_antilog(rgb[2]));
    case 11: {
      const float y = std::exp(rgb[0]);
      return rgb_from_yuv(y - kEpsilon, rgb[1] * y, rgb[2] * y);
    }
    case 12:
      return {antilog(rgb[0]), antilog(rgb[1]), antilog(rgb[2])};
    default:
      return rgb;
  }
}

Result<Factors> read_factors(BinaryReader& reader, const Header& header) {
  VENEER_ASSIGN(Factors factors,
                header.body == Body::kFactors               ? read_full(reader, header)
                : header.body == Body::kDecorrelatedFactors ? read_decorrelated(reader, header)
                                                            : read_per_view(reader, header));
  VENEER_TRY(reader.expect_end());
  return factors;
}

}  // namespace veneer::btf::ubo2014
