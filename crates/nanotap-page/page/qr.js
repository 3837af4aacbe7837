// QR codes (ISO/IEC 18004) of bytes, on the lowest level of error correction, L: versions 1 to 40.

const LEVEL = 1;              // the code of level L
/** By version: codewords of error correction in a block, and blocks. */
const EACH = [7, 10, 15, 20, 26, 18, 20, 24, 30, 18, 20, 24, 26, 30, 22, 24, 28, 30, 28, 28, 28, 28, 30, 30, 26, 28, 30, 30, 30, 30, 30, 30, 30, 30, 30, 30, 30, 30, 30, 30];
const BLOCKS = [1, 1, 1, 1, 1, 2, 2, 2, 2, 4, 4, 4, 4, 4, 6, 6, 6, 6, 7, 8, 8, 9, 9, 10, 12, 12, 12, 13, 14, 15, 16, 17, 18, 19, 19, 20, 21, 22, 24, 25];
const MASKS = [
  (x, y) => (x + y) % 2, (x, y) => y % 2, (x) => x % 3, (x, y) => (x + y) % 3,
  (x, y) => (Math.floor(x / 3) + Math.floor(y / 2)) % 2, (x, y) => x * y % 2 + x * y % 3,
  (x, y) => (x * y % 2 + x * y % 3) % 2, (x, y) => ((x + y) % 2 + x * y % 3) % 2,
];

// The field of 256 elements: powers of 2, and logarithms.
const EXP = new Uint8Array(510);
const LOG = new Uint8Array(256);
for (let k = 0, x = 1; k < 255; k += 1) {
  EXP[k] = EXP[k + 255] = x;
  LOG[x] = k;
  x = x << 1 ^ (x & 128 ? 0x11d : 0);
}
const times = (a, b) => (a && b ? EXP[LOG[a] + LOG[b]] : 0);

/** The codewords of error correction of a block (Reed and Solomon). */
function correction(data, count) {
  let divisor = [1];
  for (let k = 0; k < count; k += 1) divisor = [...divisor, 0].map((c, i) => c ^ (i ? times(divisor[i - 1], EXP[k]) : 0));
  const rest = new Array(count).fill(0);
  for (const byte of data) {
    const factor = byte ^ rest.shift();
    rest.push(0);
    for (let i = 0; i < count; i += 1) rest[i] ^= times(divisor[i + 1], factor);
  }
  return rest;
}

/** The centres of the small squares along a side. */
function squares(version) {
  if (version === 1) return [];
  const count = Math.floor(version / 7) + 2;
  const step = version === 32 ? 26 : 2 * Math.ceil((4 * version + 4) / (2 * count - 2));
  return [6, ...Array.from({ length: count - 1 }, (_, k) => 4 * version + 10 - step * (count - 2 - k))];
}

/** Bits for data and their correction. */
function room(version) {
  const side = squares(version).length;
  const fixed = side ? 25 * side ** 2 - 10 * side - 55 + (version > 6 ? 36 : 0) : 0;
  return (16 * version + 128) * version + 64 - fixed;
}

/** The codewords of some bytes in the order of the code, or nothing if they are too many. */
function codewords(bytes, version) {
  const all = Math.floor(room(version) / 8);
  const [own, count] = [EACH[version - 1], BLOCKS[version - 1]];
  const long = version > 9;
  if (bytes.length + (long ? 3 : 2) > all - own * count) return null;
  // Four bits that say "bytes", the length, the bytes, four bits that end them: halves of codewords.
  const length = [12, 8, 4, 0].slice(long ? 0 : 2).map((shift) => bytes.length >> shift & 15);
  const halves = [4, ...length, ...[...bytes].flatMap((byte) => [byte >> 4, byte & 15]), 0];
  const data = Array.from({ length: all - own * count }, (_, k) => (2 * k < halves.length ? halves[2 * k] << 4 | halves[2 * k + 1] : 0));
  for (let k = halves.length / 2; k < data.length; k += 1) data[k] = (k - halves.length / 2) % 2 ? 0x11 : 0xec;
  const shorter = count - all % count;
  let from = 0;
  const parts = [];
  for (let k = 0; k < count; k += 1) {
    const part = data.slice(from, from += Math.floor(all / count) - own + (k < shorter ? 0 : 1));
    parts.push([part, correction(part, own)]);
  }
  const across = (which) => Array.from({ length: Math.ceil(all / count) }, (_, k) => parts.flatMap((part) => part[which].slice(k, k + 1))).flat();
  return [...across(0), ...across(1)];
}

/** Draws what does not depend on the data: `true` and `false`; the rest stays undefined. */
function frame(version) {
  const size = 4 * version + 17;
  const rows = Array.from({ length: size }, () => new Array(size));
  const put = (x, y, dark) => { if (rows[y] && x >= 0 && x < size) rows[y][x] = dark; };
  const square = (x, y, reach, light) => {
    for (let v = -reach; v <= reach; v += 1) for (let u = -reach; u <= reach; u += 1) put(x + u, y + v, !light.includes(Math.max(Math.abs(u), Math.abs(v))));
  };
  for (let k = 0; k < size; k += 1) { put(6, k, k % 2 === 0); put(k, 6, k % 2 === 0); }
  for (const [x, y] of [[3, 3], [size - 4, 3], [3, size - 4]]) square(x, y, 4, [2, 4]);
  const centres = squares(version);
  const last = centres.length - 1;
  centres.forEach((x, i) => centres.forEach((y, k) => { if (i % last || k % last || i + k === 2 * last) square(x, y, 2, [1]); }));
  format(rows, 0);
  if (version > 6) {
    let rest = version;
    for (let k = 0; k < 12; k += 1) rest = rest << 1 ^ (rest >> 11) * 0x1f25;
    for (let k = 0; k < 18; k += 1) {
      const dark = ((version << 12 | rest) >> k & 1) === 1;
      put(size - 11 + k % 3, Math.floor(k / 3), dark);
      put(Math.floor(k / 3), size - 11 + k % 3, dark);
    }
  }
  return rows;
}

/** Draws level and mask, twice. */
function format(rows, data) {
  let rest = data;
  for (let k = 0; k < 10; k += 1) rest = rest << 1 ^ (rest >> 9) * 0x537;
  const dark = (k) => (((data << 10 | rest) ^ 0x5412) >> k & 1) === 1;
  const end = rows.length - 1;
  const along = [0, 1, 2, 3, 4, 5, 7, 8];
  for (let k = 0; k < 8; k += 1) { rows[along[k]][8] = dark(k); rows[8][end - k] = dark(k); }
  for (let k = 8; k < 15; k += 1) { rows[8][k === 8 ? 7 : 14 - k] = dark(k); rows[end - 14 + k][8] = dark(k); }
  rows[end - 7][8] = true;
}

/** How badly a code can be read, by the rules of the standard. */
function penalty(rows) {
  const lines = [...rows, ...rows.map((_, x) => rows.map((row) => row[x]))].map((line) => line.map(Number).join(""));
  let sum = 0;
  for (const line of lines) {
    for (const run of line.match(/0{5,}|1{5,}/g) ?? []) sum += run.length - 2;
    sum += 40 * (line.match(/1011101(?=0000)|(?<=0000)1011101/g) ?? []).length;
  }
  for (let y = 1; y < rows.length; y += 1) {
    for (let x = 1; x < rows.length; x += 1) if (rows[y][x] === rows[y - 1][x] && rows[y][x] === rows[y][x - 1] && rows[y][x] === rows[y - 1][x - 1]) sum += 3;
  }
  const share = rows.flat().filter(Boolean).length / rows.length ** 2;
  return sum + 10 * Math.floor(Math.abs(share - 0.5) * 20);
}

/** Of the eight masks the one that is read best. */
function best(version, words) {
  const drawn = MASKS.map((mask, number) => {
    const rows = frame(version);
    fill(rows, words, mask);
    format(rows, LEVEL << 3 | number);
    return { rows, bad: penalty(rows) };
  });
  return drawn.reduce((one, other) => (other.bad < one.bad ? other : one)).rows;
}

/** Draws the codewords in columns of two, up and down from the right. */
function fill(rows, words, mask) {
  const size = rows.length;
  let bit = 0;
  for (let right = size - 1; right > 0; right -= right === 8 ? 3 : 2) {
    const up = (right + 1 & 2) === 0;
    for (let k = 0; k < 2 * size; k += 1) {
      const x = right - k % 2;
      const y = up ? size - 1 - (k >> 1) : k >> 1;
      if (rows[y][x] !== undefined) continue;
      const dark = bit < 8 * words.length && (words[bit >> 3] >> 7 - bit % 8 & 1) === 1;
      bit += 1;
      rows[y][x] = dark !== (mask(x, y) === 0);
    }
  }
}

/** The rows of the code of a text, `true` for dark; nothing if the text is too long for one. */
export function code(text) {
  const bytes = new TextEncoder().encode(text);
  for (let version = 1; version <= 40; version += 1) {
    const words = codewords(bytes, version);
    if (words) return best(version, words);
  }
  return null;
}
