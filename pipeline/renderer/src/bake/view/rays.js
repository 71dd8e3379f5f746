// Bounding volume hierarchy of the opaque triangles, for reflection rays of the surface shader.
const LEAF = 4, BINS = 8, MOST_LEVELS = 30;

// Half the surface area of a box: [low x, y, z, high x, y, z].
function halfArea(box) {
  const [x, y, z] = [box[3] - box[0], box[4] - box[1], box[5] - box[2]];
  return x < 0 ? 0 : x * y + y * z + z * x;
}

const emptyBox = () => [Infinity, Infinity, Infinity, -Infinity, -Infinity, -Infinity];

// Enlarges a box by the box at an index of a list of boxes.
function enclose(box, boxes, index) {
  for (let k = 0; k < 3; k++) {
    box[k] = Math.min(box[k], boxes[6 * index + k]);
    box[3 + k] = Math.max(box[3 + k], boxes[6 * index + 3 + k]);
  }
}

// Sorts order[first…end) into two halves by the surface area heuristic over bins, and returns the first index of the second.
function partition(boxes, order, first, end) {
  // Find the box of the centers, and its longest axis. Centers are doubled.
  const [low, high] = [[Infinity, Infinity, Infinity], [-Infinity, -Infinity, -Infinity]];
  const center = (item, k) => boxes[6 * item + k] + boxes[6 * item + 3 + k];
  for (let at = first; at < end; at++) {
    for (let k = 0; k < 3; k++) {
      low[k] = Math.min(low[k], center(order[at], k));
      high[k] = Math.max(high[k], center(order[at], k));
    }
  }
  const sizes = high.map((value, k) => value - low[k]);
  const axis = sizes.indexOf(Math.max(...sizes));
  const middle = (first + end) >> 1;
  if (!(sizes[axis] > 0)) return middle;

  // Count the items of each bin, and find the cheapest border between two bins.
  const bin = (item) => Math.min(BINS - 1, Math.floor(((center(item, axis) - low[axis]) / sizes[axis]) * BINS));
  const counts = new Array(BINS).fill(0), bounds = counts.map(emptyBox);
  for (let at = first; at < end; at++) {
    const chosen = bin(order[at]);
    counts[chosen]++;
    enclose(bounds[chosen], boxes, order[at]);
  }
  const costs = new Array(BINS).fill(0);
  for (const [from, step] of [[0, 1], [BINS - 1, -1]]) {
    const [box, border] = [emptyBox(), step > 0 ? 1 : 0];
    for (let k = 0, at = from, count = 0; k < BINS - 1; k++, at += step) {
      count += counts[at];
      enclose(box, bounds[at], 0);
      costs[at + border] += count * halfArea(box);
    }
  }
  const best = costs.indexOf(Math.min(...costs.slice(1)), 1);

  // Swap items across the border. Use equal halves if one side is empty.
  let [left, right] = [first, end - 1];
  while (left <= right) {
    if (bin(order[left]) < best) left++;
    else [order[left], order[right--]] = [order[right], order[left]];
  }
  return left > first && left < end ? left : middle;
}

// Builds the hierarchy of `count` boxes. A node has 16 numbers: low corner of the left child, its reference, high corner, the
// reference of the right child, and both corners of the right child, with two unused numbers. References ≥ 0 are nodes;
// −(8 first + count) is a leaf of items first…first + count − 1 in the returned order.
function hierarchy(boxes, count) {
  const order = Uint32Array.from({ length: count }, (_, k) => k);
  const nodes = [];
  const build = (first, end, level) => {
    const number = nodes.length / 16;
    for (let k = 0; k < 16; k++) nodes.push(0);
    const middle = level < MOST_LEVELS / 2 ? partition(boxes, order, first, end) : (first + end) >> 1;
    [[first, middle], [middle, end]].forEach(([from, to], side) => {
      const box = emptyBox();
      for (let at = from; at < to; at++) enclose(box, boxes, order[at]);
      const at = 16 * number + 8 * side;
      for (let k = 0; k < 3; k++) [nodes[at + k], nodes[at + 4 + k]] = [box[k], box[3 + k]];
      const isLeaf = to - from <= LEAF;
      nodes[16 * number + 3 + 4 * side] = isLeaf ? -(8 * from + to - from) : build(from, to, level + 1);
    });
    return number;
  };
  build(0, count, 0);
  return { nodes: new Float32Array(nodes), order };
}

// Returns the opaque triangles in the order of the hierarchy, with 28 numbers each, and the nodes.
//   corner, is two-sided | edge, third normal's z | edge, 0 | places of two corners | third place, material, light
//   first normal, second normal's x | second normal's y and z, third normal's x and y
function rayGeometry(blocks) {
  const positions = new Float32Array(blocks.positions.buffer), places = new Float32Array(blocks.atlas.buffer);
  const normals = new Int16Array(blocks.normals.buffer), indices = new Uint32Array(blocks.indices.buffer);
  // List the triangles with their batches. Rays pass through blended surfaces.
  const triangles = [];
  for (const batch of scene.batches.filter((batch) => !batch.blended)) {
    for (let k = 0; k < batch.count; k += 3) triangles.push([batch.first + k, batch]);
  }
  const boxes = new Float32Array(6 * triangles.length);
  triangles.forEach(([first], number) => {
    const box = emptyBox();
    for (let k = 0; k < 9; k++) {
      const [axis, value] = [k % 3, positions[3 * indices[first + Math.floor(k / 3)] + (k % 3)]];
      box[axis] = Math.min(box[axis], value);
      box[3 + axis] = Math.max(box[3 + axis], value);
    }
    boxes.set(box, 6 * number);
  });
  const { nodes, order } = hierarchy(boxes, triangles.length);

  const records = new Float32Array(28 * triangles.length);
  order.forEach((number, at) => {
    const [first, batch] = triangles[number];
    const [a, b, c] = [0, 1, 2].map((k) => indices[first + k]);
    const point = (vertex) => [...positions.subarray(3 * vertex, 3 * vertex + 3)];
    const place = (vertex) => [...places.subarray(2 * vertex, 2 * vertex + 2)];
    const [l, m, n] = [a, b, c].map((vertex) => [...normals.subarray(3 * vertex, 3 * vertex + 3)].map((part) => part / 32767));
    const isTwoSided = scene.materials.list[batch.material].twoSided ? 1 : 0;
    records.set([...point(a), isTwoSided, ...add(point(b), point(a), -1), n[2], ...add(point(c), point(a), -1), 0,
      ...place(a), ...place(b), ...place(c), batch.material, batch.lit, ...l, ...m, n[0], n[1]], 28 * at);
  });
  return { nodes, records };
}
