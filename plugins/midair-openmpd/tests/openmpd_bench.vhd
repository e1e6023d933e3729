-- A simulation bench for the firmware of one OpenMPD board: bytes of "bytes.txt" in, shift-register words out.
-- The two memories stand in for those that the maker's tool generates for the chip: same ports, two clocks.
library ieee;
use ieee.std_logic_1164.all;
use ieee.numeric_std.all;

entity PhaseRAM is
  port (data : in std_logic_vector(6 downto 0); rdaddress : in std_logic_vector(3 downto 0); rdclock : in std_logic;
        wraddress : in std_logic_vector(8 downto 0); wrclock : in std_logic; wren : in std_logic;
        q : out std_logic_vector(223 downto 0));
end entity;

architecture simulated of PhaseRAM is
  type rows is array (0 to 15) of std_logic_vector(223 downto 0);
  signal memory : rows := (others => (others => '0'));
begin
  written : process (wrclock)
    variable row, place : natural;
  begin
    if rising_edge(wrclock) and wren = '1' then
      row := to_integer(unsigned(wraddress(8 downto 5)));
      place := 7 * to_integer(unsigned(wraddress(4 downto 0)));
      memory(row)(place + 6 downto place) <= data;
    end if;
  end process;
  fetched : process (rdclock) begin
    if rising_edge(rdclock) then q <= memory(to_integer(unsigned(rdaddress))); end if;
  end process;
end architecture;

library ieee;
use ieee.std_logic_1164.all;

entity AmplitudeRAM is
  port (data : in std_logic_vector(6 downto 0); rdaddress : in std_logic_vector(3 downto 0); rdclock : in std_logic;
        wraddress : in std_logic_vector(8 downto 0); wrclock : in std_logic; wren : in std_logic;
        q : out std_logic_vector(223 downto 0));
end entity;

architecture simulated of AmplitudeRAM is
begin
  same : entity work.PhaseRAM port map (data, rdaddress, rdclock, wraddress, wrclock, wren, q);
end architecture;

library ieee;
use ieee.std_logic_1164.all;
use ieee.numeric_std.all;
use std.textio.all;
use ieee.std_logic_textio.all;

entity bench is
end entity;

architecture run of bench is
  constant half_input : time := 10 ns;      -- 50 MHz
  constant half_output : time := 12.207 ns; -- 40.96 MHz = 1024 x 40 kHz
  signal running : boolean := true;
  signal recording : boolean := false;
  signal input_clock, output_clock, byte_ready, sync_out : std_logic := '0';
  signal byte_in, divider, address_read, address : std_logic_vector(7 downto 0) := (others => '0');
  signal enable, flag, phase_swap, level_swap, light_enable : std_logic;
  signal phase_enable, level_enable, color_enable, phase_turn, level_turn, color_turn : std_logic;
  signal value, phase, level : std_logic_vector(6 downto 0);
  signal light : std_logic_vector(23 downto 0);
  signal color : std_logic_vector(26 downto 0);
  signal count : std_logic_vector(9 downto 0);
  signal outputs : std_logic_vector(31 downto 0);
begin
  input_clock <= not input_clock after half_input when running else '0';
  output_clock <= not output_clock after half_output when running else '0';

  reader : entity work.CommandReader port map (
    clk => input_clock, byte_in => byte_ready, q_in => byte_in, divider => divider, t_en => enable, t_flag => flag,
    t_data => value, t_address => address_read, t_pswap => phase_swap, t_aswap => level_swap, rgb_data => light,
    rgb_en => light_enable, debugled => open);
  mapping : entity work.CalibrationAndMapping generic map (0) port map (
    clk => input_clock, t_en => enable, t_flag => flag, t_data => value, t_address => address_read,
    t_pswap => phase_swap, t_aswap => level_swap, rgb_data => (others => '0'), rgb_en => light_enable, phase => phase,
    amplitude => level, color => color, address => address, p_enable => phase_enable, a_enable => level_enable,
    c_enable => color_enable, p_swap => phase_turn, a_swap => level_turn, c_swap => color_turn);
  counter : entity work.Counter port map (input_clock, output_clock, '0', count, sync_out);
  channels : entity work.AllChannels port map (
    clk => input_clock, clk_8 => output_clock, count => count, phase => phase, amplitude => level, color => color,
    address => address, p_enable => phase_enable, a_enable => level_enable, c_enable => color_enable,
    p_swap => phase_turn, a_swap => level_turn, c_swap => color_turn, data => outputs, illumi => open, rclk => open,
    synccnt => open);

  feed : process
    file bytes : text open read_mode is "bytes.txt";
    variable row : line;
    variable number : integer;
  begin
    wait for 2 us;
    while not endfile(bytes) loop
      readline(bytes, row);
      read(row, number);
      wait until falling_edge(input_clock);
      byte_in <= std_logic_vector(to_unsigned(number, 8));
      byte_ready <= '1';
      wait until falling_edge(input_clock);
      byte_ready <= '0';
      for pause in 1 to 3 loop wait until falling_edge(input_clock); end loop;
    end loop;
    wait for 80 us; -- the new frame takes effect at the next two periods
    recording <= true;
    wait for 26 us; -- one period of 25 us and a little more
    running <= false;
    wait;
  end process;

  written : process (output_clock)
    file words : text open write_mode is "words.txt";
    variable row : line;
  begin
    if rising_edge(output_clock) and recording then
      write(row, to_integer(unsigned(count)));
      write(row, ' ');
      write(row, outputs);
      writeline(words, row);
    end if;
  end process;
end architecture;
