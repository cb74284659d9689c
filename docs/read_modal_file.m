function b = read_modal_file(file, speed, contact)
% READ_MODAL_FILE  Reduced model of one speed (0, 1, ...) and the rows of one interface, in SI units.
%   b = read_modal_file('basis.h5', 0, 'right');   runs in MATLAB and in Octave
  at = sprintf('/speed_%d/nd_0/', speed);
  read = @(path) h5read(file, path);
  if exist('OCTAVE_VERSION', 'builtin')              % has no h5read, but loads the whole file as a struct
    all_of_it = load('-hdf5', file);
    read = @(path) member(all_of_it, path);
  end
  turn = @(a) permute(a, ndims(a):-1:1);             % MATLAB and Octave see dimensions reversed
  b.omega = reshape(read([at 'modes/omega']), [], 1);            % rad/s
  for name = {'M_r', 'K_r', 'C_r', 'G_r'}
    b.(name{1}) = turn(read([at 'modes/' name{1}]));
  end
  b.phi = turn(read([at 'modes/phi']));                          % (node, axis, mode), kg^-1/2
  b.xyz = turn(read('/mesh/xyz'));                               % (node, axis), m
  b.T = turn(read([at 'interfaces/' contact '/T']));             % 6 rows u_n u_t1 u_t2 phi_n phi_t1 phi_t2
  b.rotation = turn(read(['/interfaces/' contact '/rotation'])); % rows n, t1, t2 in body axes
end

function value = member(s, path)
  names = strsplit(path(2:end), '/');
  value = getfield(s, names{:});
end
